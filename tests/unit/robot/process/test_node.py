"""The robot's main loop in real time, on a bus in memory: what wakes it, and what it does without its data."""

import threading
from collections.abc import Iterator

import pytest

from support.limits import LIMIT
from support.real_time_robot import NEVER, TICK, RealTimeRobot
from zteam.behaviors import Behavior, View
from zteam.messages import TeamState, TeamStatus, Twist, Vector3, time_from_ns
from zteam.robot.process import inputs
from zteam.robot.process import node as robot_module


@pytest.fixture
def robot() -> Iterator[RealTimeRobot]:
    """A follower that knows all fixed frames."""
    made = RealTimeRobot()
    made.say_statics()
    made.say_time(1)
    yield made
    made.close()


def test_transforms_wake_a_robot_that_waits_for_them(robot: RealTimeRobot, monkeypatch: pytest.MonkeyPatch) -> None:
    """A scan without its transforms waits for them, and the command follows as soon as they come."""
    monkeypatch.setattr(robot_module, "TF_LIMIT", NEVER)
    robot.say_scan(1)
    robot.wait_for_waiting()
    robot.say_transforms(1)
    robot.wait_for_commands(1)


def test_a_robot_does_without_transforms_that_stay_away(robot: RealTimeRobot) -> None:
    """A scan is answered without transforms too: the robot must be told to stand still."""
    robot.say_scan(1)
    robot.say_transforms(1)
    robot.wait_for_commands(1)
    for tick in range(2, 8):
        robot.say_time(tick)
        robot.say_scan(tick)
        robot.wait_for_commands(tick)


def test_a_robot_acts_once_a_scan(robot: RealTimeRobot) -> None:
    """Neither the clock nor a second bundle makes it act on the same scan again."""
    for tick in range(1, 6):
        robot.say_scan(tick)
        robot.say_transforms(tick)
        robot.say_time(tick)
        robot.say_transforms(tick)
        robot.wait_for_commands(tick)
    assert len(robot.commands) == 5


class Stopwatch(Behavior):
    """Publishes as its velocity how long ago its last step was."""

    def step(self, view: View) -> Twist:
        return Twist(Vector3(x=view.dt))


def test_a_step_knows_how_long_ago_the_last_one_was() -> None:
    """`view.dt` is 0 in the first step after GO and then the time between scans, in real time as in lock-step."""
    robot = RealTimeRobot(Stopwatch, gate=True)
    try:
        for tick in (1, 2):
            robot.ready(tick)
        robot.wait_for_status(lambda status: status.is_ready)
        robot.say_team(TeamStatus(state=TeamState.GO, epoch=1, go_stamp=time_from_ns(3 * TICK)))
        for steps, tick in enumerate((3, 4, 6), 1):
            robot.ready(tick)
            robot.wait_for_commands(steps)
        assert [command.linear.x for command in robot.commands] == [0.0, 0.1, 0.2]
    finally:
        robot.close()


@pytest.mark.parametrize("told", [True, False])
def test_a_robot_is_ready_with_its_base(told: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """With all else there it waits for `base_info`; a base that does not publish it is waited for only so long."""
    monkeypatch.setattr(inputs, "BASE_INFO_LIMIT", NEVER)
    robot = RealTimeRobot(gate=True)
    try:
        robot.say_statics()
        robot.say_time(1)
        robot.say_odometry(1)
        robot.say_transforms(1)
        robot.say_scan(1)
        robot.wait_for_text("waiting for its footprint (robot_1/base_info)")
        if told:
            robot.say_base_info()
        else:
            monkeypatch.setattr(inputs, "BASE_INFO_LIMIT", 0.0)
        robot.say_time(2)
        robot.say_transforms(2)
        robot.say_scan(2)
        robot.wait_for_text("waiting for the monitor's GO (zteam-monitor; --no-gate drives at once)")
    finally:
        robot.close()


class Held(Behavior):
    """Steps until it is let go."""

    entered = threading.Event()
    release = threading.Event()

    def step(self, view: View) -> Twist:
        """Wait within the step."""
        Held.entered.set()
        Held.release.wait(LIMIT)
        return Twist()


def test_a_long_step_keeps_no_message_waiting(monkeypatch: pytest.MonkeyPatch) -> None:
    """While the behaviour works, no thread of the bus waits for it. What has come meanwhile is taken after its step."""
    for name in ("entered", "release"):
        monkeypatch.setattr(Held, name, threading.Event())
    robot = RealTimeRobot(Held)
    try:
        robot.say_statics()
        robot.say_time(1)
        robot.say_scan(1)
        assert Held.entered.wait(LIMIT)
        statuses = robot.statuses
        robot.say_time(2)
        robot.say_scan(2)
        robot.say_transforms(2)
        robot.say_monitor()
        assert not robot.commands
        Held.release.set()
        robot.wait_for_commands(2)
        assert robot.statuses > statuses
    finally:
        Held.release.set()
        robot.close()
