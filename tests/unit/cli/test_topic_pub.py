"""`zteam topic pub` on a bus in memory: which subscribers it reaches, what it refuses, and stamps."""

import threading

import pytest
import zenoh

from support.commands import Run, run_here
from support.fake_navigation import FakeNavigation
from support.goals import make_goal
from support.limits import LIMIT
from support.named_sessions import ignore, open_named
from support.transports import Inbox, RouterProcess, wait_until_true
from zteam import names
from zteam.bus import Bus, BusOptions, MemoryHub, NoRequest
from zteam.bus.memory import MemoryTransport
from zteam.bus.options import client_config
from zteam.bus.transport import RawSample
from zteam.cli import topic
from zteam.clock import to_ns
from zteam.messages import Bool, Clock, PoseStamped, String, Time, Twist, time_from_ns
from zteam.simulator.client import SimStatus


def simulator(hub: MemoryHub, now: float) -> Bus:
    """A simulator that stands still at `now`, with two robots."""
    bus = open_named(hub, names.SIMULATOR)
    status = SimStatus("scripted", [0, 1], to_ns(0.1), 1, to_ns(now), round(now / 0.1), 1.0)
    bus.serve(names.service_key(names.SIMULATOR, "status"), NoRequest, lambda _: status)
    bus.publisher(names.CLOCK, Clock)
    for robot_id in (0, 1):
        bus.publisher(names.robot_key(robot_id, names.STALL), Bool)
    return bus


def test_it_names_its_subscribers(tools: MemoryHub, run: Run) -> None:
    """Each subscriber counts once and is named, through a wildcard too; a session without a name by its id."""
    simulator(tools, 1.0).subscribe_raw("robot_$*/cmd_vel", ignore)
    stranger = tools.bus()
    for _ in range(2):
        stranger.subscribe_raw("robot_0/cmd_vel", ignore)
    told = f"publishing geometry_msgs/msg/Twist on robot_0/cmd_vel once to 2 subscribers: session {stranger.instance}"
    assert run("zteam topic pub -1 /robot_0/cmd_vel geometry_msgs/Twist {}") == (f"{told}, sim\n", "")


def test_it_warns_at_none_and_publishes(tools: MemoryHub, run: Run) -> None:
    """Without a subscriber it names the key that may be meant, and exits with 0."""
    open_named(tools, "sim").subscribe_raw("robot_0/cmd_vel", ignore)
    out, err = run("zteam topic pub --once robot_0/cmdvel Twist")
    assert out == "publishing geometry_msgs/msg/Twist on robot_0/cmdvel once to no subscriber yet\n"
    assert err == "zteam topic pub: nothing subscribes to robot_0/cmdvel: did you mean robot_0/cmd_vel?\n"


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ("Twist '{linear: {x: .nan}}'", "Twist.linear.x: expected a finite number, got nan"),
        ("Twist '[-.inf, 0, 0] [0, 0, 0]'", ""),
        ("PoseStamped '{pose: {orientation: {w: null}}}'", "w: expected a finite number, got None"),
        ("PoseWithCovarianceStamped '{pose: {covariance: [.inf]}}'", "covariance: expected"),
    ],
)
def test_a_place_or_velocity_that_is_no_number_is_refused(words: str, told: str, tools: MemoryHub, run: Run) -> None:
    """Before anything is sent: the receiver would drop it without a word to the sender."""
    heard = list[RawSample]()
    tools.bus().subscribe_raw("x", heard.append)
    assert told in run(f"zteam topic pub -1 x {words}", 2).err
    assert not heard


@pytest.mark.parametrize("number", ["1e-1", "+1E-1", "1.e-01", ".1e0", "0.1"])
def test_a_number_may_have_an_exponent(number: str, tools: MemoryHub, run: Run) -> None:
    """YAML 1.1 takes a number such as 1e-1 for a text."""
    heard = list[Twist]()
    tools.bus().subscribe("x", Twist, lambda _key, message: heard.append(message))
    run(f"zteam topic pub -1 x Twist '{{linear: {{x: {number}}}}}'")
    assert [twist.linear.x for twist in heard] == [0.1]


def test_every_message_has_its_own_stamp(tools: MemoryHub) -> None:
    """A repeated message is stamped anew, at the moment of its publication."""
    clock, heard, codes = simulator(tools, 12.5).publisher(names.CLOCK, Clock), list[Time](), list[int]()
    tools.bus().subscribe("time", Time, lambda _key, message: heard.append(message))
    command = "zteam topic pub time Time now -r 10 --times 2"
    thread = threading.Thread(target=lambda: codes.append(run_here(command)), daemon=True)
    thread.start()
    wait_until_true(lambda: bool(heard))
    ticks = iter(range(126, 10**9))

    def has_ended() -> bool:
        clock.put(Clock(time_from_ns(next(ticks) * 100_000_000)))
        return not thread.is_alive()

    wait_until_true(has_ended)
    assert codes == [0]
    first, second = heard
    assert first == Time(12, 500_000_000)
    assert second.sec * 10 + second.nanosec // 100_000_000 >= 126


def test_it_warns_of_other_publishers_and_of_absent_robots(tools: MemoryHub, run: Run) -> None:
    """Two publishers of one command fight over a robot, and a robot that is not there moves nowhere."""
    simulator(tools, 1.0).subscribe_raw("robot_$*/cmd_vel", ignore)
    open_named(tools, "robot_1").publisher("robot_1/cmd_vel", Twist)
    warning = "robot_1/cmd_vel is published by robot_1 too: subscribers get the messages of both; end one of them"
    assert run("zteam topic pub -1 robot_1/cmd_vel Twist").err == f"zteam topic pub: {warning}\n"
    warning = "no process publishes anything of robot_9; robots: 0, 1"
    assert run("zteam topic pub -1 robot_9/cmd_vel Twist").err == f"zteam topic pub: {warning}\n"


def test_a_type_that_the_key_does_not_carry_is_refused(tools: MemoryHub, run: Run) -> None:
    """The keys of zteam have one type each: another one ends with 2 and nothing is published."""
    heard: list[RawSample] = []
    tools.bus().subscribe_raw("**", heard.append)
    for key in ("robot_0/cmd_vel", "tf", "robot_3/base_scan_1"):
        (line,) = run(f"zteam topic pub -1 {key} String", 2).err.splitlines()
        assert line.startswith(f"zteam topic: {key} carries ") and line.endswith(", not std_msgs/msg/String")
    assert heard == []


@pytest.mark.parametrize("latched", [True, False])
def test_a_type_that_is_not_heard_on_the_key_is_refused(
    latched: bool, tools: MemoryHub, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A key of the user's own carries what its publisher sends, once and latched, or all the time."""
    monkeypatch.setattr(topic, "SURVEY", LIMIT)
    publisher, over = open_named(tools, "lamp").publisher("lamp", Bool, latched=latched), threading.Event()

    def publish() -> None:
        publisher.put(Bool(True))
        while not latched and not over.wait(0.005):
            publisher.put(Bool(True))

    thread = threading.Thread(target=publish)
    thread.start()
    try:
        told = "zteam topic: lamp carries std_msgs/msg/Bool, not std_msgs/msg/String\n"
        assert run("zteam topic pub -1 lamp String", 2).err == told
        run("zteam topic pub -1 lamp Bool")
    finally:
        over.set()
        thread.join(LIMIT)


def test_a_new_key_carries_any_type(tools: MemoryHub, run: Run) -> None:
    """A key that nothing publishes takes the first type that comes, and so does one whose publisher is silent."""
    heard = Inbox()
    tools.bus().subscribe("note", String, heard)
    tools.bus().publisher("note", Bool)
    run("zteam topic pub -1 note String '{data: now}'")
    heard.wait_for(("note", String("now")))


@pytest.mark.parametrize("text", ["{header: {stamp: now}}", "{header: auto}"])
def test_now_is_the_teams_time(text: str, tools: MemoryHub, run: Run) -> None:
    """With a simulator a stamp of `now` is simulated time; with `--clock wall`, the host's."""
    heard = Inbox()
    simulator(tools, 12.5)
    tools.bus().subscribe("goal", PoseStamped, lambda _key, message: heard(message.header.stamp))
    run(f"zteam topic pub -1 goal PoseStamped '{text}'")
    run(f"zteam topic pub -1 goal PoseStamped '{text}' --clock wall")
    assert heard.items[0] == Time(12, 500_000_000)
    assert heard.items[1].sec > 1_000_000_000


def test_a_subscriber_that_tells_no_name_is_one(tools: MemoryHub, run: Run) -> None:
    """A foreign program does not tell its subscribers, but the publisher knows that there is one."""
    MemoryTransport(tools).declare_subscriber("lamp", ignore, False)
    out, err = run("zteam topic pub -1 lamp Bool")
    assert "once to subscribers that tell no name (frozen, or no processes of zteam)\n" in out and not err


@pytest.mark.ci
def test_a_subscriber_of_a_plain_zenoh_program_is_noticed(monkeypatch: pytest.MonkeyPatch, run: Run) -> None:
    """A publisher knows of the subscriber of a plain Zenoh program when the tool tells its subscribers."""
    monkeypatch.setenv("ZTEAM_LEASE", str(LIMIT))
    router = RouterProcess()
    try:
        config = client_config(BusOptions(connect=router.endpoint, lease=LIMIT))
        with zenoh.open(config) as plain:
            subscriber = plain.declare_subscriber("ns/lamp", lambda _: None)
            for _ in range(5):
                out, err = run(f"zteam topic pub -1 lamp Bool --connect {router.endpoint} --namespace ns")
                assert "to subscribers that tell no name" in out and not err
            subscriber.undeclare()
    finally:
        router.kill()


def test_a_goal_is_one_short_line(tools: MemoryHub, run: Run) -> None:
    """A goal needs its frame and its place: the rest of the message has values that mean no turn and no time."""
    navigation = FakeNavigation(tools, 2)
    goal = "{header: {frame_id: map}, pose: {position: {x: 22, y: 17}}}"
    assert "to 1 subscriber" in run(f"zteam topic pub -1 robot_2/goal_pose PoseStamped '{goal}'").out
    assert navigation.goals == [make_goal(22.0, 17.0)]
