"""The way to a robot's wheels, on a bus in memory."""

import os
import socket
import threading
from collections.abc import Callable, Iterator

import pytest

from support.limits import LIMIT
from support.log_capture import captured_log
from support.named_sessions import open_named
from support.transports import wait_until_true
from zteam import names
from zteam.bus import Bus, MemoryHub, NoRequest, presence
from zteam.bus.presence import Claim, own_info
from zteam.cli.teleop import describe
from zteam.errors import DuplicateNameError, ZteamError
from zteam.messages import RobotDriver, RobotStatus, Twist, Vector3
from zteam.node.shutdown import Stop
from zteam.node.stopping import StopReply, serve_stop
from zteam.robot import wheels as module
from zteam.robot.teleop import Pilot, drive
from zteam.robot.wheels import Turn, Wheels
from zteam.simulator.client import SimStatus

AHEAD, BACK, STILL = Twist(Vector3(0.5)), Twist(Vector3(-0.5)), Twist()


@pytest.fixture
def hub(monkeypatch: pytest.MonkeyPatch) -> MemoryHub:
    """A bus in memory, on which a token is seen at once."""
    monkeypatch.setattr(presence, "CLAIM_WAIT", 0.0)
    return MemoryHub()


def take(hub: MemoryHub, robot_id: int = 0, stop: Stop | None = None) -> Wheels:
    """The wheels of a robot, taken in a session of their own."""
    wheels = Wheels(hub.bus(), robot_id, stop or Stop())
    wheels.take()
    return wheels


def hear(bus: Bus, key: str) -> list[Twist]:
    """The commands on a key from now on."""
    heard: list[Twist] = []
    bus.subscribe(key, Twist, lambda _key, command: heard.append(command))
    return heard


def test_without_a_process_the_base_is_driven_under_the_robots_name(hub: MemoryHub) -> None:
    """Commands go to cmd_vel alone; a robot that comes is refused, until the wheels are given back. What drives the
    base answers for the robot's stop: zero at once and for each command, until the release."""
    bus = hub.bus()
    base, mux = hear(bus, "robot_0/cmd_vel"), hear(bus, "robot_0/cmd_vel_teleop")
    wheels = take(hub)
    wheels.drive(AHEAD)
    assert (wheels.direct, base, mux) == (True, [AHEAD], [])
    with pytest.raises(DuplicateNameError, match="robot_0 is taken by process"):
        Claim(hub.bus(), "robot_0").win(lambda _: None)
    assert bus.ask("robot_0/stop/engage", StopReply) == StopReply("robot_0", True)
    assert base == [AHEAD, STILL]
    wheels.drive(AHEAD)
    bus.ask("robot_0/stop/release", StopReply)
    # What was commanded meanwhile is not made up for.
    assert base == [AHEAD, STILL, STILL, STILL]
    wheels.drive(AHEAD)
    assert base[-1] == AHEAD
    wheels.close()
    assert bus.query("robot_0/stop", StopReply) == []
    Claim(hub.bus(), "robot_0").win(lambda _: None)


@pytest.fixture
def time(monkeypatch: pytest.MonkeyPatch) -> Callable[[], None]:
    """Host time by hand; each call lets a while pass."""
    times = [100.0]
    monkeypatch.setattr(module, "monotonic", lambda: times[-1])
    return lambda: times.append(times[-1] + 2 * module.GAP)


def test_the_newest_key_drives(hub: MemoryHub, time: Callable[[], None]) -> None:
    """Of two teleops of one robot the one sends whose key was pressed last; an idle one is silent, and its last zero
    does not stop the robot. Both logs say who drives."""
    robot = open_named(hub, "robot_0")
    mux = hear(robot, "robot_0/cmd_vel_teleop")
    first, second = take(hub), take(hub)
    time()
    with captured_log() as log:
        first.press()
        first.drive(AHEAD)
        first.drive(Twist())
        second.press()
        second.drive(BACK)
        first.drive(Twist())
        first.drive(AHEAD)
        second.drive(BACK)
        assert mux == [AHEAD, Twist(), BACK, BACK]
        assert (first.gives_way, second.gives_way) == (True, False)
        me = f"(process {os.getpid()} on {socket.gethostname()})"
        # Each of the two gives way once.
        wait_until_true(lambda: log.count("robot_0: driven by ") == 2)
        assert log.count(me) == 2
        assert me in first.others[0]
        assert "| driven by " in describe(Pilot((0,), 0.5, 1.0), first)
        time()
        first.press()
        first.drive(AHEAD)
        assert mux[-1] == AHEAD
        assert (first.gives_way, second.gives_way) == (False, True)


def test_a_teleop_without_the_robots_process_takes_the_commands_of_another(
    hub: MemoryHub, time: Callable[[], None]
) -> None:
    """The first one drives the base under the robot's name; the second one's keys reach the base through it."""
    base = hear(hub.bus(), "robot_0/cmd_vel")
    first, second = take(hub), take(hub)
    time()
    first.press()
    first.drive(AHEAD)
    second.press()
    second.drive(BACK)
    first.drive(Twist())
    assert (first.direct, second.direct, second.unheard) == (True, False, "")
    assert base == [AHEAD, BACK]
    hub.bus().ask("robot_0/stop/engage", StopReply)
    second.drive(BACK)
    assert base == [AHEAD, BACK, Twist()]


@pytest.mark.parametrize(
    ("story", "gives_way"),
    [
        ([("a", STILL, 1.0)], True),
        ([("press", STILL, 0.1), ("a", STILL, 0.2), ("a", STILL, 0.3)], False),
        ([("press", STILL, 0.1), ("a", STILL, 0.2), ("a", AHEAD, 0.3)], True),
        ([("a", AHEAD, 0.9), ("press", STILL, 1.0), ("a", AHEAD, 1.1), ("a", AHEAD, 1.3)], False),
        ([("a", AHEAD, 0.5), ("press", STILL, 1.0), ("a", AHEAD, 1.1)], True),
        ([("press", STILL, 1.0), ("a", STILL, 9.0), ("press", STILL, 9.1), ("a", STILL, 9.2)], False),
        ([("press", STILL, 0.1), *(("a", AHEAD, 0.1 * n) for n in range(2, 6))], False),
        ([("press", STILL, 0.1), *(("a", AHEAD, 0.1 * n) for n in range(2, 8))], True),
        ([("press", STILL, 0.1), *((who, AHEAD, 0.1 * n) for n in range(2, 20) for who in ("a", "own"))], False),
    ],
    ids=["begins", "was before", "moves", "on its way", "comes back", "taken back", "just idle", "idle", "both move"],
)
def test_a_key_is_known_by_its_commands(story: list[tuple[str, Twist, float]], gives_way: bool) -> None:
    """Another one's key was pressed when its commands begin, or begin to move; those under way are older.
    An idle one gives way to one that moves the robot."""
    turn = Turn(0.0)
    for sender, command, now in story:
        if sender == "press":
            turn.take(now)
        elif sender == "own":
            turn.command(command, now)
        else:
            turn.hear(sender, command, now)
    assert bool(turn.other) == gives_way


def test_a_robot_that_the_world_lacks_is_refused(hub: MemoryHub) -> None:
    """The error names the robots that the simulator has."""
    status = SimStatus("arena", [0, 2], 100, 1, 0, 0, 1.0)
    open_named(hub, names.SIMULATOR).serve("sim/status", NoRequest, lambda _: status)
    take(hub, 2)
    with pytest.raises(ZteamError, match="robot_1 is not in the world; it has 0, 2"):
        take(hub, 1)


def test_an_older_holder_of_the_name_ends_teleop(hub: MemoryHub) -> None:
    """After a healed network two processes drive one base: the younger one stops."""
    stop, asked = Stop(), threading.Event()
    stop.on_request(asked.set)
    take(hub, 0, stop)
    older = hub.bus()
    older.serve("robot_0/info", NoRequest, lambda _: own_info("robot_0", older.instance, 1))
    older.declare_token(names.token_key("robot_0", older.instance))
    assert asked.wait(LIMIT)
    assert stop.reason.endswith(", which is older")


@pytest.mark.parametrize("failing", [False, True])
def test_the_end_of_the_presses_stops_the_robots(hub: MemoryHub, failing: bool) -> None:
    """Whether they end or fail, the last command is zero; the robot that was left got its zero before."""
    outside = hub.bus()
    heard = {robot_id: hear(outside, f"robot_{robot_id}/cmd_vel") for robot_id in (0, 1)}
    wheels = {robot_id: take(hub, robot_id) for robot_id in (0, 1)}

    def presses() -> Iterator[tuple[list[str], float]]:
        yield ["i"], 1.0
        yield ["tab", "i"], 1.1
        yield [], 1.2
        if failing:
            raise RuntimeError

    def drive_all() -> None:
        drive(Pilot((0, 1), 0.5, 1.0), wheels, presses(), lambda: None)

    if failing:
        with pytest.raises(RuntimeError):
            drive_all()
    else:
        drive_all()
    assert heard == {0: [AHEAD, Twist()], 1: [AHEAD, AHEAD, Twist()]}


STATUS = RobotStatus(robot_id=0, driver=RobotDriver.TELEOP, reason="an obstacle ahead")
SLOWED = "teleop drives 0.25 m/s, 0.00 rad/s, wanted 0.50 m/s, 0.00 rad/s: an obstacle ahead"


@pytest.mark.parametrize(
    ("told", "driven", "text"),
    [
        (None, AHEAD, "no status yet"),
        (STATUS, AHEAD, "teleop drives 0.50 m/s, 0.00 rad/s: an obstacle ahead"),
        (STATUS, Twist(Vector3(0.25)), SLOWED),
        (RobotStatus(robot_id=0, is_stopped=True), Twist(), "stopped (zteam stop --release)"),
    ],
)
def test_the_line_tells_what_the_robot_does(hub: MemoryHub, told: RobotStatus | None, driven: Twist, text: str) -> None:
    """Robot and speeds of the keys, then driver, speed and reason; the wanted speed too if the robot is slower."""
    robot = open_named(hub, "robot_0")
    base, mux = hear(robot, "robot_0/cmd_vel"), hear(robot, "robot_0/cmd_vel_teleop")
    wheels = take(hub)
    wheels.drive(AHEAD)
    assert (wheels.direct, base, mux) == (False, [], [AHEAD])
    robot.publisher("robot_0/cmd_vel", Twist).put(driven)
    if told is not None:
        robot.publisher("robot_0/status", RobotStatus).put(told)
    assert describe(Pilot((0,), 0.5, 1.0), wheels) == f"robot_0: keys 0.50 m/s, 1.00 rad/s | {text}"


def test_the_line_of_a_base_without_a_process(hub: MemoryHub) -> None:
    """It says that nothing hears the commands, or the newest command and that nothing makes it safe, or that the robot
    is stopped, as its teammates are."""
    lines = []
    for prepare in (
        lambda: None,
        lambda: hear(hub.bus(), "robot_0/cmd_vel"),
        lambda: serve_stop(hub.bus(), 1, "robot_1", lambda: True, lambda _: None),
    ):
        prepare()
        wheels = take(hub)
        wheels.drive(AHEAD)
        lines.append(describe(Pilot((0,), 0.5, 1.0), wheels).partition(" | ")[2])
        wheels.close()
    assert lines == [
        "nothing hears robot_0/cmd_vel",
        "0.50 m/s, 0.00 rad/s straight to the base, no safety layer",
        "stopped (zteam stop --release)",
    ]
