"""What the robot says of itself in real time: its status, its log, and that it is stopped."""

import math
import threading
from collections.abc import Callable

import pytest

from support.limits import LIMIT
from support.log_capture import captured_log
from support.real_time_robot import RealTimeRobot
from support.transports import wait_until_true
from zteam import names
from zteam.behaviors import Behavior, View
from zteam.bus import NoRequest
from zteam.bus.presence import own_info
from zteam.clock import FREEZES, monotonic
from zteam.messages import (
    Header,
    RobotDriver,
    RobotState,
    TeamStatus,
    Twist,
    TwistStamped,
    Vector3,
    time_from_ns,
)
from zteam.node import node as node_module
from zteam.node.stopping import StopReply
from zteam.reasons import Reason
from zteam.robot.behaviors.wander import Idle
from zteam.robot.process import node as robot_module
from zteam.robot.process.driver import SafetyLog

Start = Callable[..., RealTimeRobot]
STOPPED = "stopped (zteam stop --release)"
ALONE = ": no data from its base (no simulator: zteam-sim WORLD)"


class EveryBeat:
    """Instead of `Every`: a heartbeat in each round of the main loop, or none at all."""

    is_due = True

    def __init__(self, period: float) -> None:
        pass

    def due(self) -> bool:
        """Always or never."""
        return self.is_due

    def left(self) -> float:
        """Long: rounds come from looks at whether data has stopped."""
        return LIMIT


@pytest.fixture
def beats(monkeypatch: pytest.MonkeyPatch) -> type[EveryBeat]:
    """Heartbeats without waiting."""
    monkeypatch.setattr(node_module, "Every", EveryBeat)
    monkeypatch.setattr(EveryBeat, "is_due", True)
    return EveryBeat


class Asks(Behavior):
    """Wants what the test wants. It counts its steps and releases, and its third step may wait."""

    wanted = Twist()
    entered = threading.Event()
    free: threading.Event | None = None

    def __init__(self, params: object) -> None:
        super().__init__(params)
        self.steps: list[tuple[float, int]] = []
        """`dt` of each, and how often time was to begin anew before it."""
        self.releases = 0

    def step(self, view: View) -> Twist:
        """That velocity."""
        self.steps.append((round(view.dt, 6), self.releases))
        if len(self.steps) == 3 and self.free is not None:
            self.entered.set()
            self.free.wait(LIMIT)
        return Asks.wanted

    def on_release(self) -> None:
        self.releases += 1


@pytest.fixture
def want(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Sets the velocity that the behaviour wants: m/s, rad/s."""

    def want(speed: float, turn: float = 0.0) -> None:
        monkeypatch.setattr(Asks, "wanted", Twist(Vector3(speed), Vector3(z=turn)))

    want(0.2)
    return want


def steps_of(robot: RealTimeRobot) -> list[tuple[float, int]]:
    """Those of its behaviour."""
    behavior = robot.robot.driver.behavior
    assert isinstance(behavior, Asks)
    return behavior.steps


@pytest.mark.usefixtures("beats")
def test_it_says_what_drives_it_and_why_it_stands(start: Start, want: Callable[..., None]) -> None:
    """Behaviour, driver, speed and reason follow the newest command."""
    robot = start(Asks)
    before = robot.wait_for_status(lambda _: True)
    assert (before.behavior, before.driver, before.leader) == ("Asks", RobotDriver.NONE, -1)
    for tick, (speed, turn, reason) in enumerate(
        [(0.4, 0.0, ""), (0.0, 0.7, ""), (-0.1, 0.0, ""), (0.0, 0.0, "the behaviour commands zero velocity")], 1
    ):
        want(speed, turn)
        robot.step(tick)
        said = robot.wait_for_status(lambda status, due=(speed, reason): (status.speed, status.reason) == due)  # type: ignore[misc]
        assert (said.driver, said.state, said.text) == (RobotDriver.BEHAVIOR, RobotState.RUNNING, "")
    want(0.4)
    robot.step(5, distance=0.3)
    said = robot.wait_for_status(lambda status: status.reason == "obstacle ahead")
    assert (said.speed, said.text) == (0.0, "obstacle ahead")
    robot.close()
    robot.node.halt()
    assert (robot.said[-1].driver, robot.said[-1].reason, robot.said[-1].speed) == ("none", "stopped", 0.0)


@pytest.mark.usefixtures("beats")
def test_a_shipped_behaviour_says_why_it_stands(start: Start) -> None:
    """Its own word is in the status, and neither in the text nor a line of the log."""
    with captured_log() as log:
        robot = start(Idle)
        robot.step(1)
        said = robot.wait_for_status(lambda status: status.driver == RobotDriver.BEHAVIOR)
    assert (said.reason, said.text, log.count("idle")) == ("idle: only teleop or navigation drives it", "", 0)


def test_a_new_speed_is_no_reason_to_publish(
    start: Start, want: Callable[..., None], beats: type[EveryBeat], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Speeds that change with every tick go out with the heartbeat alone."""
    monkeypatch.setattr(beats, "is_due", False)
    robot = start(Asks)
    robot.step(1)
    robot.wait_for_status(lambda status: status.state == RobotState.RUNNING)
    before = len(robot.said)
    for tick in range(2, 9):
        want(0.1 + 0.001 * tick)
        robot.step(tick)
    assert len(robot.said) == before


@pytest.mark.parametrize(
    ("say", "lack"), [(RealTimeRobot.say_scan, "odometry"), (RealTimeRobot.say_odometry, "a first scan")]
)
@pytest.mark.usefixtures("beats")
def test_a_robot_that_nothing_reaches_says_so(start: Start, say: Callable[..., None], lack: str) -> None:
    """It may be a real one, too: then its base sends nothing. With the first data of it that is over."""
    robot = start(Idle, gate=True)
    said = robot.wait_for_status(lambda status: status.reason.endswith(ALONE))
    assert said.text == said.reason
    assert said.text.startswith("waiting for a first scan (robot_1/base_scan), odometry (robot_1/odom)")
    say(robot, 1)
    robot.wait_for_status(lambda status: status.text.startswith(f"waiting for {lack}") and ALONE not in status.text)
    with captured_log() as log:
        # Without a gate it has no status to wait in.
        start(Idle)
        wait_until_true(lambda: f"waiting for a first scan{ALONE}" in log.lines)


@pytest.mark.parametrize("gate", [True, False])
@pytest.mark.usefixtures("beats", "want")
def test_a_robot_that_the_world_lacks_says_so(start: Start, gate: bool) -> None:
    """Which robots the world has, and how to add this one, while it waits and while it runs; not once it is there."""
    robot = start(Asks, gate=gate)
    lacks = "robot_1 is not in the world; it has 0, 3-5 ('zteam sim spawn --id 1 --pose X Y YAW' adds it)"
    if not gate:
        robot.step(1)
    robot.say_world(0, 3, 4, 5)
    for tick in () if gate else range(50, 80):
        # It steps as time goes on without a scan.
        robot.say_time(tick)
        robot.wait_for_more_statuses(1)
    said = robot.wait_for_status(lambda status: lacks in status.reason)
    assert said.text == said.reason == (f"waiting for its first scan: {lacks}" if gate else lacks)
    robot.say_scan(80)
    robot.wait_for_status(
        lambda status: status.text.startswith("waiting for odometry") if gate else status.speed == 0.2
    )


@pytest.mark.gate
@pytest.mark.usefixtures("beats", "want")
def test_a_ready_robot_tells_whom_go_waits_for(start: Start, monkeypatch: pytest.MonkeyPatch) -> None:
    """What the monitor waits for is in its log once, when it has been ready for a while, and again when it changes."""
    monkeypatch.setattr(robot_module, "_TELL_EVERY", 2)
    with captured_log() as log:
        robot = start(Asks, gate=True)
        robot.say_team(TeamStatus(waiting_for="robot_2: no process yet"))
        robot.ready(1)
        log.wait_for("ready; GO waits for robot_2: no process yet")
        robot.say_team(TeamStatus(waiting_for="robot_2: waiting for a first scan"))
        log.wait_for("ready; GO waits for robot_2: waiting for a first scan")
        assert log.count("no process yet") == 1


@pytest.fixture
def driving(start: Start, want: Callable[..., None], monkeypatch: pytest.MonkeyPatch) -> RealTimeRobot:
    """A robot that drives, and that looks often at what comes, from `look_often` on."""
    monkeypatch.setattr(node_module, "HEARTBEAT", 0.02)
    monkeypatch.setattr(robot_module, "_LOOKS", math.inf)
    made = start(Asks)
    made.ready(1)
    made.wait_for_commands(1)
    return made


def look_often(monkeypatch: pytest.MonkeyPatch) -> None:
    """From now on each heartbeat is a look: before, what is there was not all there."""
    monkeypatch.setattr(robot_module, "_LOOKS", 0)


def answer(robot: RealTimeRobot, name: str) -> None:
    """Another process is there and answers."""
    bus = robot.session()
    bus.serve(names.info_key(name), NoRequest, lambda _: own_info(name, bus.instance, 0))


@pytest.mark.parametrize(
    ("token", "others", "why"),
    [
        (True, True, "the simulator does not answer"),
        (False, True, "the simulator has ended"),
        (True, False, "no other process answers"),
    ],
)
def test_a_robot_says_once_that_nothing_comes(
    driving: RealTimeRobot, token: bool, others: bool, why: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In its log and its status, whose velocity is zero then; and once that data comes again."""
    with captured_log() as log:
        if token:
            driving.say_token(names.SIMULATOR)
        if others:
            answer(driving, names.AGGREGATOR)
        look_often(monkeypatch)
        told = driving.wait_for_status(lambda status: bool(status.reason))
        assert (told.reason, told.speed) == (f"no data: {why}", 0.0)
        driving.wait_for_more_statuses(5)
        driving.ready(2)
        driving.wait_for_status(lambda status: not status.reason and status.speed > 0.0)
        driving.wait_for_status(lambda _: log.count("data comes again") == 1)
    assert log.count("no data") == 1


@pytest.mark.parametrize("is_frozen", [True, False])
def test_a_world_that_stands_and_a_freeze_of_its_own_are_no_outage(
    driving: RealTimeRobot, is_frozen: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The simulator answers; or that nothing has come is the robot's own doing."""
    if is_frozen:
        monkeypatch.setattr(FREEZES, "look", monotonic)
        answer(driving, names.AGGREGATOR)
    else:
        driving.say_token(names.SIMULATOR)
        driving.say_world(0, 1)
    look_often(monkeypatch)
    assert driving.wait_for_more_statuses(20).reason == ""


def test_time_begins_anew_after_a_pause(driving: RealTimeRobot, monkeypatch: pytest.MonkeyPatch) -> None:
    """A step after a freeze has no `dt`: the base stood meanwhile, and that the robot did not get on does not count."""
    # The host's time goes by as well.
    monkeypatch.setattr(FREEZES, "look", monotonic)
    for count, tick in enumerate((2, 3, 103, 104), start=2):
        driving.ready(tick)
        driving.wait_for_commands(count)
    assert steps_of(driving) == [(0.0, 0), (0.1, 0), (0.1, 0), (0.0, 1), (0.1, 1)]


def test_no_old_command_is_braked_from_after_a_pause(
    driving: RealTimeRobot, want: Callable[..., None], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A robot that finds its data old after a pause commands zero velocity at once: its base has stood meanwhile."""
    monkeypatch.setattr(FREEZES, "look", monotonic)
    want(0.6)
    driving.ready(2)
    driving.wait_for_commands(2)
    assert speeds(driving)[-1] > 0.3
    driving.say_time(103)
    driving.wait_for_commands(3)
    assert speeds(driving)[-1] == 0.0


def change(robot: RealTimeRobot, service: str) -> StopReply:
    """Stop the robot, or release it."""
    return robot.bus.ask(names.robot_key(1, service), StopReply)


def speeds(robot: RealTimeRobot) -> list[float]:
    """Those commanded so far."""
    return [command.linear.x for command in robot.commands]


@pytest.mark.usefixtures("want")
def test_a_stop_is_at_once_and_lasts_until_the_release(start: Start) -> None:
    """Zero is commanded before the query is answered, and then with each scan. Neither teleop nor navigation drives,
    the behaviour is not asked, and goes on where it was, with `on_release` first."""
    robot = start(Asks)
    change(robot, names.ENGAGE)
    robot.wait_for_status(lambda status: status.is_stopped and status.reason == STOPPED)
    change(robot, names.RELEASE)
    for tick in (1, 2):
        robot.ready(tick)
        robot.wait_for_commands(1 + tick)
    assert change(robot, names.ENGAGE) == StopReply("robot_1", True)
    assert speeds(robot) == [0.0, 0.2, 0.2, 0.0]
    robot.wait_for_status(lambda status: status.is_stopped and status.reason == STOPPED and status.speed == 0.0)
    robot.say("robot_1/cmd_vel_teleop", Twist(Vector3(0.3)))
    robot.say("robot_1/cmd_vel_nav", TwistStamped(Header(time_from_ns(1)), Twist(Vector3(0.3))))
    for tick in (3, 4, 20):
        # After 20 both have let go of the robot.
        robot.step(tick)
    assert change(robot, names.RELEASE) == StopReply("robot_1", False)
    robot.step(21)
    assert speeds(robot)[4:] == [0.0, 0.0, 0.0, 0.2]
    assert [releases for _, releases in steps_of(robot)] == [0, 0, 1]
    robot.wait_for_status(lambda status: not status.is_stopped and status.reason == "")


@pytest.mark.usefixtures("want")
def test_a_behaviour_that_hangs_does_not_hold_the_stop_up(start: Start, monkeypatch: pytest.MonkeyPatch) -> None:
    """Zero is commanded while it works, and what it returns afterwards is not."""
    free = threading.Event()
    monkeypatch.setattr(Asks, "free", free)
    monkeypatch.setattr(Asks, "entered", threading.Event())
    robot = start(Asks)
    for tick in (1, 2):
        robot.step(tick)
    robot.ready(3)
    assert Asks.entered.wait(LIMIT)
    change(robot, names.ENGAGE)
    assert speeds(robot) == [0.2, 0.2, 0.0]
    free.set()
    robot.wait_for_commands(4)
    assert speeds(robot) == [0.2, 0.2, 0.0, 0.0]


def test_the_log_has_a_line_for_a_stop_and_one_when_the_way_is_free() -> None:
    """The first names driver, command and cause; one that comes and goes is one stop; the second comes when the way
    has been free for a second, not while the robot turns away. A robot that is slowed and then stopped has two lines.
    """
    safety, ahead = SafetyLog("forward"), Twist(Vector3(0.4))

    def note(begin: int, end: int, wanted: Twist, trouble: Callable[[int], str], driver: str = "behavior") -> None:
        for tick in range(begin, end):
            safety.note(driver, wanted, trouble(tick), tick * 100_000_000)

    with captured_log() as log:
        note(1, 39, ahead, lambda tick: "obstacle ahead" if tick % 3 else "")
        assert log.lines == ["safety: stopped forward (0.40 m/s): obstacle ahead"]
        note(40, 60, Twist(angular=Vector3(z=1.0)), lambda _: "")
        assert len(log.lines) == 1
        note(60, 90, ahead, lambda _: "")
        assert log.lines[1:] == ["safety: the way is free again after 5.9 s"]
        unseen = Reason("it cannot see behind", slows=True)
        back = Twist(Vector3(-0.4))
        note(90, 98, back, lambda tick: unseen if tick < 94 else "robot_2 behind", RobotDriver.TELEOP)
        note(98, 120, ahead, lambda _: "")
        note(120, 121, Twist(Vector3(y=0.2)), lambda _: Reason("it cannot see left", slows=True))
    assert log.lines[2:] == [
        "safety: teleop backs up slowly: it cannot see behind",
        "safety: stopped teleop (-0.40 m/s): robot_2 behind",
        "safety: the way is free again after 0.8 s",
        "safety: forward drives slowly: it cannot see left",
    ]
    assert safety.stops == 3
