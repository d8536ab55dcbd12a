"""What a robot does, and says, in real time while nothing comes, and after that; on a bus in memory."""

from collections.abc import Iterator

import pytest

from support.log_capture import captured_log
from support.real_time_robot import TICK, RealTimeRobot
from zteam import names
from zteam.behaviors import Behavior, View
from zteam.bus import NoRequest
from zteam.bus.presence import own_info
from zteam.clock import FREEZES, monotonic
from zteam.messages import RobotStatus, Twist, Vector3
from zteam.node import node as node_module
from zteam.robot.behaviors.behavior import declared_inputs
from zteam.robot.behaviors.line import STATUSES
from zteam.robot.process import node as robot_module
from zteam.robot.process.inputs import DeclaredInputs
from zteam.robot.view import SILENT_AFTER

pytestmark = pytest.mark.gate


class Counting(Behavior):
    """Drives, and keeps what it was told of time."""

    inputs = STATUSES
    steps: list[tuple[float, int]]
    """Of each step: `dt`, and how often time was to begin anew before it."""

    def __init__(self, params: object) -> None:
        super().__init__(params)
        Counting.steps = []
        self.releases = 0

    def step(self, view: View) -> Twist:
        self.steps.append((round(view.dt, 6), self.releases))
        return Twist(Vector3(0.2))

    def on_release(self) -> None:
        self.releases += 1


@pytest.fixture
def robot(monkeypatch: pytest.MonkeyPatch) -> Iterator[RealTimeRobot]:
    """A robot that drives, and that looks often at what comes."""
    monkeypatch.setattr(node_module, "HEARTBEAT", 0.05)
    monkeypatch.setattr(robot_module, "_LOOKS", 0)
    made = RealTimeRobot(Counting)
    made.ready(1)
    made.wait_for_commands(1)
    yield made
    made.close()


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
def test_a_robot_says_once_that_nothing_comes(robot: RealTimeRobot, token: bool, others: bool, why: str) -> None:
    """In its log and its status, whose velocity is zero then; and once that data comes again."""
    with captured_log() as log:
        if token:
            robot.say_token(names.SIMULATOR)
        if others:
            answer(robot, names.AGGREGATOR)
        told = robot.wait_for_status(lambda status: bool(status.reason))
        assert (told.reason, told.speed) == (f"no data: {why}", 0.0)
        count = robot.statuses
        robot.wait_for_status(lambda _: robot.statuses > count + 5)
        robot.ready(2)
        robot.wait_for_status(lambda status: not status.reason and status.speed > 0.0)
        robot.wait_for_status(lambda _: log.count("data comes again") == 1)
    assert log.count("no data") == 1


def test_a_world_that_stands_is_no_outage(robot: RealTimeRobot) -> None:
    """Its simulator answers."""
    robot.say_token(names.SIMULATOR)
    robot.say_world(0, 1)
    count = robot.statuses
    assert robot.wait_for_status(lambda _: robot.statuses > count + 20).reason == ""


def test_a_robot_that_was_frozen_accuses_nobody(robot: RealTimeRobot, monkeypatch: pytest.MonkeyPatch) -> None:
    """That nothing has come is its own doing."""
    monkeypatch.setattr(FREEZES, "look", monotonic)
    answer(robot, names.AGGREGATOR)
    count = robot.statuses
    assert robot.wait_for_status(lambda _: robot.statuses > count + 20).reason == ""


def test_poses_that_stay_away_are_told_once(robot: RealTimeRobot) -> None:
    """By a robot that drives by its laser alone too."""
    with captured_log() as log:
        for tick in range(2, 6):
            count = robot.statuses
            robot.say_time(tick)
            robot.say_scan(tick)
            robot.wait_for_status(lambda _, count=count: robot.statuses > count + 3)  # type: ignore[misc]
        assert robot_module.NO_POSES in robot.text
        robot.ready(6)
        robot.wait_for_status(lambda status: robot_module.NO_POSES not in status.text)
    assert (log.count("no new poses"), log.count("poses come again")) == (1, 1)


def test_time_begins_anew_after_a_pause(robot: RealTimeRobot, monkeypatch: pytest.MonkeyPatch) -> None:
    """A step after a freeze has no `dt`: the base stood meanwhile, and that the robot did not get on does not count."""
    # The host's time goes by as well.
    monkeypatch.setattr(FREEZES, "look", monotonic)
    for count, tick in enumerate((2, 3, 103, 104), start=2):
        robot.ready(tick)
        robot.wait_for_commands(count)
    assert Counting.steps == [(0.0, 0), (0.1, 0), (0.1, 0), (0.0, 1), (0.1, 1)]


def test_a_silent_teammate_is_known(monkeypatch: pytest.MonkeyPatch) -> None:
    """By simulated time in lock-step, else by the host's, from when it could be heard on."""
    declared = declared_inputs(STATUSES, 1)
    inputs, key, now = DeclaredInputs(declared), names.robot_key(2, names.STATUS), monotonic()
    inputs.take(declared[0], key, RobotStatus(robot_id=2), TICK)
    late = TICK + round(SILENT_AFTER * 1e9)
    assert [inputs.silent(stamp) for stamp in (late, late + 1)] == [frozenset(), {2}]
    assert inputs.silent(None) == frozenset()
    monkeypatch.setattr("zteam.robot.process.inputs.monotonic", lambda: now + 1.0 + SILENT_AFTER)
    assert [inputs.silent(None, heard_from) for heard_from in (now, now + 2.0)] == [{2}, frozenset()]
