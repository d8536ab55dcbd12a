"""`zteam topic pub` on a bus in memory: which subscribers it reaches, what it refuses, and stamps."""

import itertools
import threading
from collections.abc import Iterator

import pytest
import zenoh

from support.fake_navigation import FakeNavigation
from support.goals import make_goal
from support.limits import LIMIT
from support.named_sessions import ignore, open_named
from support.transports import Inbox, RouterProcess, wait_until_true
from zteam import names
from zteam.bus import Bus, BusOptions, MemoryHub, NoRequest
from zteam.bus.bus import Publisher
from zteam.bus.graph import Graph, find_graph
from zteam.bus.memory import MemoryTransport
from zteam.bus.options import client_config
from zteam.bus.transport import RawSample
from zteam.cli import topic
from zteam.clock import to_ns
from zteam.messages import Bool, Clock, PoseStamped, String, Time, Twist, time_from_ns
from zteam.simulator.client import SimStatus


@pytest.fixture
def hub(monkeypatch: pytest.MonkeyPatch) -> MemoryHub:
    """The bus of the tool and of everything else."""
    hub = MemoryHub()
    monkeypatch.setattr(topic, "open_bus", lambda _options: hub.bus())
    monkeypatch.setattr(topic, "SURVEY", 0.05)
    return hub


def simulator(hub: MemoryHub, now: float) -> Bus:
    """A simulator that stands still at `now`, with two robots."""
    bus = open_named(hub, names.SIMULATOR)
    status = SimStatus("scripted", [0, 1], to_ns(0.1), 1, to_ns(now), round(now / 0.1), 1.0)
    bus.serve(names.service_key(names.SIMULATOR, "status"), NoRequest, lambda _: status)
    bus.publisher(names.CLOCK, Clock)
    for robot_id in (0, 1):
        bus.publisher(names.robot_key(robot_id, names.STALL), Bool)
    return bus


def test_it_names_its_subscribers(hub: MemoryHub, capsys: pytest.CaptureFixture[str]) -> None:
    """Each subscriber counts once and is named, through a wildcard too; a session without a name by its id."""
    simulator(hub, 1.0).subscribe_raw("robot_$*/cmd_vel", ignore)
    stranger = hub.bus()
    for _ in range(2):
        stranger.subscribe_raw("robot_0/cmd_vel", ignore)
    assert topic.main(["pub", "-1", "/robot_0/cmd_vel", "geometry_msgs/Twist", "{}"]) == 0
    printed = capsys.readouterr()
    names_told = f"session {stranger.instance}, sim"
    expected = f"publishing geometry_msgs/msg/Twist on robot_0/cmd_vel once to 2 subscribers: {names_told}"
    assert printed.out == expected + "\n"
    assert printed.err == ""


def test_it_warns_at_none_and_publishes(hub: MemoryHub, capsys: pytest.CaptureFixture[str]) -> None:
    """Without a subscriber it names the key that may be meant, and exits with 0."""
    open_named(hub, "sim").subscribe_raw("robot_0/cmd_vel", ignore)
    assert topic.main(["pub", "--once", "robot_0/cmdvel", "Twist"]) == 0
    printed = capsys.readouterr()
    assert printed.out == "publishing geometry_msgs/msg/Twist on robot_0/cmdvel once to no subscriber yet\n"
    (line,) = printed.err.splitlines()
    assert line == "zteam topic pub: nothing subscribes to robot_0/cmdvel: did you mean robot_0/cmd_vel?"


def run_clock_until_end(clock: Publisher[Clock], thread: threading.Thread) -> None:
    """Publish ticks from 12.6 s on until the tool has ended in its thread."""
    ticks = itertools.count(126)

    def has_ended() -> bool:
        clock.put(Clock(time_from_ns(next(ticks) * 100_000_000)))
        return not thread.is_alive()

    wait_until_true(has_ended)


def test_it_tells_when_a_subscriber_comes(hub: MemoryHub, capsys: pytest.CaptureFixture[str]) -> None:
    """While it publishes, the first subscriber to come is named."""
    heard, late = Inbox(), open_named(hub, "robot_7")
    clock = simulator(hub, 12.5).publisher(names.CLOCK, Clock)
    codes: list[int] = []
    words = ["pub", "-r", "10", "--times", "3", "lamp", "Bool", "{data: true}"]
    thread = threading.Thread(target=lambda: codes.append(topic.main(words)), daemon=True)
    thread.start()
    printed: list[str] = []

    def is_told() -> bool:
        printed.append(capsys.readouterr().out)
        return "".join(printed).endswith("\n")

    wait_until_true(is_told)
    late.subscribe("lamp", Bool, heard)
    run_clock_until_end(clock, thread)
    assert codes == [0]
    # It is told before the first message, so the subscriber may get that one, too.
    assert heard.items in ([("lamp", Bool(True))] * 2, [("lamp", Bool(True))] * 3)
    lines = ("".join(printed) + capsys.readouterr().out).splitlines()
    assert lines == [
        "publishing std_msgs/msg/Bool on lamp 3 times at 10 Hz to no subscriber yet",
        "publishing on lamp to 1 subscriber: robot_7",
    ]


def test_it_warns_of_other_publishers_and_of_absent_robots(hub: MemoryHub, capsys: pytest.CaptureFixture[str]) -> None:
    """Two publishers of one command fight over a robot, and a robot that is not there moves nowhere."""
    simulator(hub, 1.0).subscribe_raw("robot_$*/cmd_vel", ignore)
    open_named(hub, "robot_1").publisher("robot_1/cmd_vel", Twist)
    assert topic.main(["pub", "-1", "robot_1/cmd_vel", "Twist"]) == 0
    warning = "robot_1/cmd_vel is published by robot_1 too: subscribers get the messages of both; end one of them"
    assert capsys.readouterr().err == f"zteam topic pub: {warning}\n"
    assert topic.main(["pub", "-1", "robot_9/cmd_vel", "Twist"]) == 0
    assert capsys.readouterr().err == "zteam topic pub: no process publishes anything of robot_9; robots: 0, 1\n"


@pytest.mark.parametrize("key", ["robot_0/cmd_vel", "tf", "robot_3/base_scan_1"])
def test_a_type_that_the_key_does_not_carry_is_refused(
    key: str, hub: MemoryHub, capsys: pytest.CaptureFixture[str]
) -> None:
    """The keys of zteam have one type each: another one ends with 2 and nothing is published."""
    heard: list[RawSample] = []
    hub.bus().subscribe_raw("**", heard.append)
    assert topic.main(["pub", "-1", key, "String"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"zteam topic: {key} carries ")
    assert line.endswith(", not std_msgs/msg/String")
    assert heard == []


@pytest.fixture(params=[True, False], ids=["latched", "live"])
def lamp(request: pytest.FixtureRequest, hub: MemoryHub) -> Iterator[None]:
    """A process that publishes Bool on a key of its own, once and latched, or all the time."""
    publisher, over = open_named(hub, "lamp").publisher("lamp", Bool, latched=request.param), threading.Event()

    def publish() -> None:
        while not over.wait(0.005):
            publisher.put(Bool(True))

    publisher.put(Bool(True))
    thread = threading.Thread(target=publish, daemon=True)
    if not request.param:
        thread.start()
    yield
    over.set()
    if not request.param:
        thread.join(LIMIT)


def test_a_type_that_is_not_heard_on_the_key_is_refused(
    lamp: None, hub: MemoryHub, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A key of the user's own carries what its publishers send; the same type is accepted."""
    monkeypatch.setattr(topic, "SURVEY", LIMIT)
    assert topic.main(["pub", "-1", "lamp", "String"]) == 2
    assert capsys.readouterr().err == "zteam topic: lamp carries std_msgs/msg/Bool, not std_msgs/msg/String\n"
    assert topic.main(["pub", "-1", "lamp", "Bool"]) == 0


def test_a_new_key_carries_any_type(hub: MemoryHub) -> None:
    """A key that nothing publishes takes the first type that comes, and so does one whose publisher is silent."""
    heard = Inbox()
    hub.bus().subscribe("note", String, heard)
    hub.bus().publisher("note", Bool)
    assert topic.main(["pub", "-1", "note", "String", "{data: now}"]) == 0
    heard.wait_for(("note", String("now")))


@pytest.mark.parametrize("text", ["{header: {stamp: now}}", "{header: auto}"])
def test_now_is_the_teams_time(text: str, hub: MemoryHub) -> None:
    """With a simulator a stamp of `now` is simulated time; with `--clock wall`, the host's."""
    heard = Inbox()
    simulator(hub, 12.5)
    hub.bus().subscribe("goal", PoseStamped, lambda _key, message: heard(message.header.stamp))
    assert topic.main(["pub", "-1", "goal", "PoseStamped", text]) == 0
    assert heard.items == [Time(12, 500_000_000)]
    assert topic.main(["pub", "-1", "goal", "PoseStamped", text, "--clock", "wall"]) == 0
    assert heard.items[1].sec > 1_000_000_000


def test_every_message_has_its_own_stamp(hub: MemoryHub) -> None:
    """A repeated message is stamped anew, at the moment of its publication."""
    heard = Inbox()
    clock = simulator(hub, 12.5).publisher(names.CLOCK, Clock)
    hub.bus().subscribe("time", Time, lambda _key, message: heard(message))
    words = ["pub", "time", "Time", "now", "-r", "10", "--times", "2"]
    thread = threading.Thread(target=topic.main, args=(words,), daemon=True)
    thread.start()
    heard.wait_for(Time(12, 500_000_000))
    run_clock_until_end(clock, thread)
    assert len(heard.items) == 2
    assert heard.items[1].sec * 10 + heard.items[1].nanosec // 100_000_000 >= 126


def test_a_subscriber_that_tells_no_name_is_one(hub: MemoryHub, capsys: pytest.CaptureFixture[str]) -> None:
    """A foreign program does not tell its subscribers, but the publisher knows that there is one."""
    MemoryTransport(hub).declare_subscriber("lamp", ignore, False)
    assert topic.main(["pub", "-1", "lamp", "Bool"]) == 0
    printed = capsys.readouterr()
    expected = "publishing std_msgs/msg/Bool on lamp once to subscribers that tell no name"
    assert printed.out == f"{expected} (frozen, or no processes of zteam)\n"
    assert printed.err == ""


def test_a_subscriber_that_comes_during_the_question_is_named(
    hub: MemoryHub, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """One that the first answer does not have is asked for its name."""

    def ask(bus: Bus) -> Graph:
        monkeypatch.undo()
        monkeypatch.setattr(topic, "open_bus", lambda _options: hub.bus())
        graph = find_graph(bus)
        open_named(hub, "robot_7").subscribe_raw("lamp", ignore)
        return graph

    monkeypatch.setattr(topic, "find_graph", ask)
    assert topic.main(["pub", "-1", "lamp", "Bool"]) == 0
    assert capsys.readouterr().out == "publishing std_msgs/msg/Bool on lamp once to 1 subscriber: robot_7\n"


def test_a_subscriber_of_a_plain_zenoh_program_is_noticed(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A publisher knows of the subscriber of a plain Zenoh program when the tool tells its subscribers."""
    monkeypatch.setenv("ZTEAM_LEASE", str(LIMIT))
    router = RouterProcess()
    try:
        config = client_config(BusOptions(connect=router.endpoint, lease=LIMIT))
        with zenoh.open(config) as plain:
            subscriber = plain.declare_subscriber("ns/lamp", lambda _: None)
            for _ in range(10):
                words = ["pub", "-1", "lamp", "Bool", "--connect", router.endpoint, "--namespace", "ns"]
                assert topic.main(words) == 0
            subscriber.undeclare()
    finally:
        router.kill()
    printed = capsys.readouterr()
    assert printed.out.count("to subscribers that tell no name") == 10
    assert printed.err == ""


def test_a_goal_is_one_short_line(hub: MemoryHub, capsys: pytest.CaptureFixture[str]) -> None:
    """A goal needs its frame and its place: the rest of the message has values that mean no turn and no time."""
    navigation = FakeNavigation(hub, 2)
    goal = "{header: {frame_id: map}, pose: {position: {x: 22, y: 17}}}"
    assert topic.main(["pub", "-1", "robot_2/goal_pose", "PoseStamped", goal]) == 0
    assert navigation.goals == [make_goal(22.0, 17.0)]
    assert "on robot_2/goal_pose once to 1 subscriber" in capsys.readouterr().out
    assert topic.main(["pub", "-1", "robot_2/goal_pose", "Twist", "{}"]) == 2
    assert "robot_2/goal_pose carries geometry_msgs/msg/PoseStamped, not " in capsys.readouterr().err
