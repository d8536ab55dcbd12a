"""A robot that is stopped, in real time on a bus in memory: what it commands, and what its behaviour is asked."""

import threading

import pytest

from support.limits import LIMIT
from support.real_time_robot import RealTimeRobot
from zteam import names
from zteam.behaviors import Behavior, View
from zteam.bus import Bus
from zteam.messages import Header, RobotDriver, RobotState, Twist, TwistStamped, Vector3, time_from_ns
from zteam.node.stopping import StopReply

STOPPED = "stopped (zteam stop --release)"


class Counting(Behavior):
    """Drives at a speed that says how many steps it has had, and how often it was released."""

    entered = threading.Event()
    free: threading.Event | None = None
    """What its third step waits for."""

    def __init__(self, params: object) -> None:
        super().__init__(params)
        self.steps, self.releases = 0, 0

    def step(self, view: View) -> Twist:
        self.steps += 1
        if self.steps == 3 and self.free is not None:
            self.entered.set()
            self.free.wait(LIMIT)
        return Twist(Vector3(0.01 * self.steps + 0.5 * self.releases))

    def on_release(self) -> None:
        self.releases += 1


@pytest.fixture
def robot() -> "RealTimeRobot":
    """Robot 1, which drives, after two steps."""
    made = RealTimeRobot(Counting)
    for tick in (1, 2):
        made.ready(tick)
        made.wait_for_commands(tick)
    return made


def change(robot: RealTimeRobot, service: str) -> StopReply:
    """Stop the robot, or release it."""
    bus: Bus = robot.session()
    return bus.ask(names.robot_key(1, service), StopReply)


def speeds(robot: RealTimeRobot) -> list[float]:
    """Those commanded so far."""
    return [round(command.linear.x, 6) for command in robot.commands]


def test_zero_does_not_wait_for_a_scan_and_lasts_until_the_release(robot: RealTimeRobot) -> None:
    """It is commanded before the query is answered, and then with each scan. Neither teleop nor navigation drives, the
    behaviour is not asked, and goes on where it was, with `on_release` first."""
    try:
        assert speeds(robot) == [0.01, 0.02]
        assert change(robot, names.ENGAGE) == StopReply("robot_1", True)
        assert speeds(robot) == [0.01, 0.02, 0.0]
        robot.wait_for_status(lambda status: status.is_stopped and status.reason == STOPPED and status.speed == 0.0)
        for tick, driver in ((3, "behavior"), (4, RobotDriver.TELEOP), (5, RobotDriver.NAVIGATION)):
            if driver == RobotDriver.TELEOP:
                robot.say("robot_1/cmd_vel_teleop", Twist(Vector3(0.3)))
            elif driver == RobotDriver.NAVIGATION:
                robot.say("robot_1/cmd_vel_nav", TwistStamped(Header(time_from_ns(1)), Twist(Vector3(0.3))))
            robot.ready(tick)
            robot.wait_for_commands(tick + 1)
        assert speeds(robot)[2:] == [0.0] * 4
        robot.wait_for_status(lambda status: status.state == RobotState.RUNNING and status.text == STOPPED)
        # Both let go of the robot after half a second.
        robot.ready(20)
        robot.wait_for_commands(7)
        assert change(robot, names.RELEASE) == StopReply("robot_1", False)
        robot.ready(21)
        robot.wait_for_commands(8)
        assert speeds(robot)[6:] == [0.0, 0.53]
        robot.wait_for_status(lambda status: not status.is_stopped and status.reason == "")
    finally:
        robot.close()


def test_a_behaviour_that_hangs_does_not_hold_the_stop_up(monkeypatch: pytest.MonkeyPatch) -> None:
    """Zero is commanded while it works, and what it returns afterwards is not."""
    free = threading.Event()
    monkeypatch.setattr(Counting, "free", free)
    monkeypatch.setattr(Counting, "entered", threading.Event())
    robot = RealTimeRobot(Counting)
    try:
        for tick in (1, 2):
            robot.ready(tick)
            robot.wait_for_commands(tick)
        robot.ready(3)
        assert Counting.entered.wait(LIMIT)
        change(robot, names.ENGAGE)
        assert speeds(robot) == [0.01, 0.02, 0.0]
        free.set()
        robot.wait_for_commands(4)
        assert speeds(robot) == [0.01, 0.02, 0.0, 0.0]
    finally:
        free.set()
        robot.close()


def test_a_robot_is_stopped_before_it_drives() -> None:
    """While it waits for its data it says that it is stopped; with its first step it stands."""
    robot = RealTimeRobot(Counting)
    try:
        change(robot, names.ENGAGE)
        robot.wait_for_status(lambda status: status.is_stopped and status.reason == STOPPED)
        robot.ready(1)
        robot.wait_for_commands(2)
        assert speeds(robot) == [0.0, 0.0]
    finally:
        robot.close()
