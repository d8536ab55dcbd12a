"""A robot that stands and sees the same keeps what it worked out: until anything changes that the answer hangs on."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from support.flat_floor import LASER, TICK, cast, drive, make_odometry, make_scan, make_view
from zteam import names
from zteam.behaviors import SafetyLayer, View
from zteam.behaviors.safety import layer as safety_layer
from zteam.behaviors.safety.surroundings import Surroundings
from zteam.geometry import Pose2
from zteam.messages import Twist, Vector3

Left = list[tuple[float, float, str]]


class Robot:
    """A robot in a dead end that asks for whatever it is told to; the world may change under it."""

    def __init__(self) -> None:
        self.layer, self.pose, self.now = SafetyLayer(), Pose2(0.0, 0.0, 0.0), 100 * TICK
        self.slip = Pose2(0.0, 0.0, 0.0)
        """The odometry is wrong by this."""
        self.mate: Pose2 | None = None
        """Where robot 1 is in `map`: no laser sees it."""
        self.shorter = 0.0
        """Metres less of the beam straight ahead."""
        self.dazzled = 0
        """Beams to either side of straight ahead that say nothing."""
        self.left: Left = []

    def view(self) -> View:
        """What it sees: its scans cannot be changed, as those that come over the bus."""
        ranges = cast(self.pose.compose(LASER), [(1.0, -1.5, 1.0, 1.5), (-3.0, 1.5, 1.0, 1.5), (-3.0, -1.5, 1.0, -1.5)])
        middle = ranges.size // 2
        ranges[middle] -= self.shorter
        ranges[middle - self.dazzled : middle + self.dazzled] = math.nan
        scan = make_scan(ranges, self.now)
        scan.ranges.flags.writeable = False
        odom = make_odometry(self.slip.compose(self.pose))
        return make_view(scan, now=self.now, odom=odom, team=(0, 1), lookup=self._look)

    def _look(self, target: str, source: str) -> tuple[Pose2, int] | None:
        if source == names.robot_frame(0, names.BASE_LASER_LINK):
            return LASER, 0
        pose = self.mate if source.startswith("robot_1") else self.pose
        return None if pose is None else (pose, self.now)

    def step(self, speed: float, turn: float = 0.0, times: int = 1) -> None:
        """Some ticks."""
        for _ in range(times):
            command, why = self.layer.limit(Twist(Vector3(speed), Vector3(z=turn)), self.view())
            self.left.append((command.linear.x, command.angular.z, why))
            self.pose, self.now = drive(self.pose, command, TICK / 1e9), self.now + TICK

    def back_up_to_the_wall(self) -> None:
        """It comes to stand with its rear before the wall, which it remembers."""
        self.step(0.5, times=25)
        self.step(0.0, math.pi / 2.5, times=25)
        self.step(-0.4, times=25)


def another_wish(robot: Robot) -> None:
    """Stopped before the wall it turns a little, and wants to drive on."""
    robot.step(0.2, times=80)
    robot.step(0.0, 0.3, times=2)
    robot.step(0.2, times=5)


def a_beam_changes(robot: Robot) -> None:
    """One beam says that something stands nearer, while the robot is stalled."""
    robot.pose = Pose2(0.5, 0.0, 0.0)
    for robot.shorter in (0.0, 0.0, 0.3, 0.3, 0.0, 0.0):
        robot.step(0.2)
        robot.pose = Pose2(0.5, 0.0, 0.0)


def a_teammate_comes(robot: Robot) -> None:
    """Robot 1 comes near while robot 0 is stalled, and leaves."""
    for robot.mate in (None, None, None, Pose2(0.5, 0.0, math.pi), Pose2(0.5, 0.0, math.pi), Pose2(9.0, 0.0, 0.0)):
        # What has no pose is looked up once a second.
        for _ in range(11):
            robot.step(0.2)
            robot.pose = Pose2(0.0, 0.0, 0.0)


def a_teammate_comes_behind(robot: Robot) -> None:
    """Robot 1 comes near on the other side of the wall that robot 0 stands close before, stopped by one sure beam."""
    robot.pose = Pose2(0.8, 0.0, 0.0)
    robot.step(0.2)
    robot.shorter = 0.01
    for robot.mate in (None, Pose2(1.3, 0.0, math.pi), Pose2(9.0, 0.0, 0.0)):
        robot.step(0.2, times=11)
    robot.step(-0.2)


def a_teammate_stops_it(robot: Robot) -> None:
    """Robot 1 stops it before a wall, and leaves: more than before has to be free then."""
    for robot.mate in (None, Pose2(1.0, 0.0, math.pi), Pose2(-9.0, 0.0, 0.0)):
        for _ in range(11):
            robot.pose = Pose2(0.68, 0.0, 0.0)
            robot.step(0.2)


def a_teammate_inches_nearer(robot: Robot) -> None:
    """Robot 1 stops it, stands, comes a centimetre nearer, and turns."""
    for robot.mate in (Pose2(0.6, 0.0, math.pi), Pose2(0.59, 0.0, math.pi), Pose2(0.59, 0.0, 2.0)):
        robot.step(0.2, times=20)


def a_teammate_dazzles(robot: Robot) -> None:
    """Robot 1 explains, from behind the wall, why some beams say nothing, and leaves."""
    robot.dazzled = 4
    for robot.mate in (None, Pose2(3.0, 0.0, math.pi), Pose2(0.0, 9.0, 0.0)):
        for _ in range(11):
            robot.step(0.2)
            robot.pose = Pose2(0.0, 0.0, 0.0)


def odometry_jumps(robot: Robot) -> None:
    """It was set down elsewhere, and sees the same there: nothing is remembered."""
    robot.back_up_to_the_wall()
    robot.slip = Pose2(5.0, 0.0, 0.0)
    robot.step(-0.4, times=3)


def odometry_slips(robot: Robot) -> None:
    """Its wheels turned, and it sees the same: the remembered wall is further away."""
    robot.back_up_to_the_wall()
    robot.slip = Pose2(-0.3, 0.0, 0.0)
    robot.step(-0.4, times=3)


def scans_are_kept(robot: Robot) -> None:
    """Its wheels turn bit by bit, and it keeps scan after scan that says the same."""
    robot.back_up_to_the_wall()
    for i in range(30):
        robot.slip = Pose2(-0.02 * i, 0.0, 0.0)
        robot.step(-0.4)


CHANGES = [
    a_beam_changes,
    a_teammate_comes,
    a_teammate_comes_behind,
    a_teammate_stops_it,
    a_teammate_inches_nearer,
    a_teammate_dazzles,
    odometry_jumps,
    odometry_slips,
    scans_are_kept,
    another_wish,
]


@pytest.mark.parametrize("change", CHANGES)
def test_what_is_kept_is_never_old(change: Callable[[Robot], None]) -> None:
    """Each command and its cause are the same as those of a robot that keeps nothing."""
    robot, other = Robot(), Robot()
    change(robot)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Surroundings, "keep", lambda around, asked, answer: answer)
        change(other)
    assert robot.left == other.left
    assert len({speed for speed, _, _ in robot.left}) > 1


@pytest.fixture
def looks(monkeypatch: pytest.MonkeyPatch) -> list[None]:
    """Grows with each search for what an arc meets."""
    found: list[None] = []
    meeting_time = safety_layer.meeting_time

    def counted(*args: object) -> float:
        found.append(None)
        return meeting_time(*args)  # type: ignore[arg-type]

    monkeypatch.setattr(safety_layer, "meeting_time", counted)
    return found


def test_a_robot_that_stands_works_out_once_what_stops_it(looks: list[None]) -> None:
    """With the same scan, pose and wish; not with another wish, and not where it moves."""
    robot = Robot()
    robot.back_up_to_the_wall()
    assert robot.left[-1][0] == 0.0
    assert len(looks) > 3
    looks.clear()
    robot.step(-0.4, times=5)
    assert not looks
    robot.step(-0.05)
    assert len(looks) == 1


def test_a_robot_that_stands_works_out_once_which_teammate_stops_it(looks: list[None]) -> None:
    """As long as the teammate stands too; not when that one comes nearer."""
    robot = Robot()
    robot.mate = Pose2(0.6, 0.0, math.pi)
    robot.step(0.2, times=20)
    assert robot.left[-1] == (0.0, 0.0, "robot_1 ahead")
    assert looks
    looks.clear()
    robot.step(0.2, times=5)
    assert not looks
    robot.mate = Pose2(0.59, 0.0, math.pi)
    robot.step(0.2)
    assert looks


def test_little_is_kept() -> None:
    """A robot that is stuck may wish for something else in each step."""
    robot = Robot()
    for turn in np.linspace(0.1, 1.0, 50):
        robot.step(0.3, float(turn))
        robot.pose = Pose2(0.4, 0.0, 0.0)
    assert len(robot.layer._around.known) <= 16
