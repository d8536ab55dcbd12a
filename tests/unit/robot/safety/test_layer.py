"""The safety layer from step to step: it slows down before it stops, does not chatter, and brakes on old data."""

import math

import numpy as np
import pytest

from support.flat_floor import LASER, TICK, Segment, cast, drive, make_odometry, make_scan, make_view
from zteam import names
from zteam.behaviors import Behavior, SafetyLayer, View, decide
from zteam.geometry import Pose2
from zteam.messages import Twist, Vector3
from zteam.messages.base import Base
from zteam.robot.safety.motion import BRAKING

FRONT, REAR = 0.125, 0.225
"""Metres from an erratic's origin to its outline."""
START = 100 * TICK
SPEED = 0.5


class Drive:
    """A robot on a flat floor that asks for whatever it is told to, from step to step."""

    def __init__(self, walls: list[Segment], base: Base | None = None, pose: Pose2 | None = None) -> None:
        self.walls, self.base, self.pose = walls, base or Base(), pose or Pose2(0.0, 0.0, 0.0)
        self.layer, self.now, self.reason = SafetyLayer(), START, ""
        self.command = 0.0, 0.0
        """What was left of the last one: m/s, rad/s."""
        self.noise = np.random.default_rng(1)
        self.scan_noise = 0.0
        self.slope = 1.0
        """By how much it drives faster than it is told."""

    def view(self) -> View:
        """What it sees."""
        ranges = cast(self.pose.compose(LASER), self.walls)
        ranges += self.scan_noise * self.noise.standard_normal(ranges.size)
        scan = make_scan(np.clip(ranges, 0.01, 30.0), self.now)
        odom = make_odometry(self.pose)
        odom.twist.twist.linear.x = self.slope * self.command[0]
        return make_view(scan, now=self.now, base=self.base, odom=odom, laser=LASER[:2])

    def step(self, speed: float, turn: float = 0.0) -> float:
        """One tick; the speed that was left."""
        command, self.reason = self.layer.limit(Twist(Vector3(speed), Vector3(z=turn)), self.view())
        self.pose, self.now = drive(self.pose, command, self.slope * TICK / 1e9), self.now + TICK
        self.command = command.linear.x, command.angular.z
        return command.linear.x


def test_it_slows_down_before_it_stops() -> None:
    """Towards a wall the speed falls step by step, no faster than the base can brake, and the robot ends in front of
    its gap."""
    robot = Drive([(3.0, -5.0, 3.0, 5.0)])
    speeds = [robot.step(0.8) for _ in range(80)]
    assert speeds[0] == 0.8
    assert speeds[-1] == 0.0
    assert robot.reason == "obstacle ahead"
    falls = -np.diff(speeds)
    assert (falls >= 0.0).all()
    assert falls.max() <= BRAKING * 0.1 + 0.021
    assert np.count_nonzero(falls) >= 6
    assert 0.15 <= 3.0 - robot.pose.x - FRONT <= 0.15 + 0.06


def test_what_odometry_says_counts_where_the_base_is_faster_than_it_is_told() -> None:
    """Down a ramp it drives 1.6 times as fast as commanded: it is slowed down in time all the same."""
    robot = Drive([(4.0, -5.0, 4.0, 5.0)])
    robot.slope = 1.6
    speeds = [robot.step(1.0) for _ in range(100)]
    assert speeds[0] == 1.0
    assert speeds[-1] == 0.0
    assert 0.0 < 4.0 - robot.pose.x - FRONT < 0.5


@pytest.mark.parametrize("noise", [0.0, 0.01])
@pytest.mark.parametrize("speed", [0.3, 0.8])
def test_no_chatter_at_the_edge(speed: float, noise: float) -> None:
    """A robot that was stopped before a wall stays stopped, with a noise of 1 cm in every beam too."""
    robot = Drive([(2.0, -5.0, 2.0, 5.0)])
    robot.scan_noise = noise
    speeds = [robot.step(speed) for _ in range(200)]
    stopped = speeds.index(0.0)
    assert stopped < 100
    assert not any(speeds[stopped:])


def test_it_gets_away_from_a_wall_beside_it_that_its_tail_would_touch() -> None:
    """It is to turn away from a wall at 3 cm: it drives straight on where its tail has no room to turn."""
    side = -Base().half_width - 0.03
    robot = Drive([(-9.0, side, 9.0, side)])
    for _ in range(60):
        robot.step(0.3, 1.0)
    assert robot.pose.y > 0.3


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_robot_near_both_walls_of_a_corner_can_turn(side: float) -> None:
    """Two corners of its outline are 7 mm from the walls, nearer than the margin. The turn brings neither nearer."""
    yaw, edge = side * -0.76, 0.007
    corners = [Pose2(0.0, 0.0, yaw).compose(Pose2(x, y, 0.0)) for x, y in Base().footprint]
    right, top = max(corner.x for corner in corners) + edge, max(side * corner.y for corner in corners) + edge
    robot = Drive([(right, -9.0, right, 9.0), (-9.0, side * top, 9.0, side * top)], pose=Pose2(0.0, 0.0, yaw))
    for _ in range(20):
        robot.step(0.0, side * 1.5)
    assert side * robot.pose.yaw > 0.2


def test_it_drives_on_when_the_way_is_free() -> None:
    """What is stopped is not held for ever: the obstacle goes away, and the robot drives at once."""
    robot = Drive([(2.0, -5.0, 2.0, 5.0)])
    while robot.step(0.8):
        pass
    robot.walls = []
    assert robot.step(0.8) == 0.8
    assert robot.reason == ""


def test_it_backs_up_slowly_where_no_laser_looks() -> None:
    """At 0.2 m/s, and it says why; in an arc its fastest corner does. With a laser that looks behind it is as fast as
    asked."""
    robot = Drive([(-20.0, 1.0, 20.0, 1.0)])
    for _ in range(10):
        robot.step(SPEED)
    assert robot.step(-SPEED) == -0.2
    assert robot.reason == "it cannot see behind"
    robot.step(-SPEED, 0.5)
    assert fastest_corner(robot) == pytest.approx(0.2)
    assert robot.step(-0.1) == -0.1
    assert robot.reason == ""
    round_view = make_view(make_scan([30.0] * 361, START, math.tau), now=START)
    assert SafetyLayer().limit(Twist(Vector3(-SPEED)), round_view) == (Twist(Vector3(-SPEED)), "")


@pytest.mark.parametrize(("fov", "speed"), [(20.0, 0.2), (60.0, SPEED), (180.0, SPEED)])
def test_it_drives_on_slowly_where_its_laser_hardly_looks(fov: float, speed: float) -> None:
    """A laser has to see 15 degrees to either side of a way forwards."""
    view = make_view(make_scan([30.0] * 61, START, math.radians(fov)), now=START)
    command, why = SafetyLayer().limit(Twist(Vector3(SPEED)), view)
    assert (command.linear.x, why) == (speed, "" if speed == SPEED else "it cannot see ahead")


def test_it_drives_no_faster_than_it_could_stop_within_what_its_laser_sees() -> None:
    """Beyond its range a laser has seen nothing."""
    scan = make_scan([0.5] * 181, START, math.pi)
    scan.range_max = 0.5
    command, why = SafetyLayer().limit(Twist(Vector3(1.0)), make_view(scan, now=START))
    assert why == "it cannot see ahead"
    speed = command.linear.x
    assert 0.1 * speed + 0.5 * speed**2 == pytest.approx(0.5)


def fastest_corner(robot: Drive) -> float:
    """m/s, of what was left of the last command."""
    speed, turn = robot.command
    return max(math.hypot(speed - turn * y, turn * x) for x, y in robot.base.footprint)


@pytest.mark.parametrize(("speed", "turn", "side"), [(0.0, 3.0, "behind"), (0.3, -3.0, "ahead"), (-1.0, 3.0, "behind")])
def test_no_corner_is_fast_over_ground_never_seen(speed: float, turn: float, side: str) -> None:
    """Backed up over other ground than it drove over, a robot turns so that no corner is faster than 0.2 m/s. Where it
    was put down, and where it drove to forwards, it turns as fast as is asked for."""
    robot = Drive([(-20.0, 1.0, 20.0, 1.0)])
    robot.step(0.0, 3.0)
    assert robot.command[1] == 3.0
    robot = Drive([(-20.0, 1.0, 20.0, 1.0)])
    for _ in range(30):
        robot.step(-0.5)
    robot.step(speed, turn)
    assert fastest_corner(robot) == pytest.approx(0.2)
    assert robot.reason == f"it cannot see {side}"
    for _ in range(40):
        robot.step(0.5, -math.atan2(robot.pose.y, 1.0) - robot.pose.yaw)
    robot.step(0.0, 3.0)
    assert robot.command[1] == 3.0
    assert robot.reason == ""


BASE = Base(acc_lim_x=1.0, decel_lim_x=-2.0, acc_lim_theta=3.0)


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_bases_accelerations_hold_both_ways(way: float) -> None:
    """It gains speed and loses it as the base tells, forwards and backwards, to the left and to the right; to turn
    round it first comes to a stand."""
    layer, now = SafetyLayer(), START

    def step(speed: float, turn: float) -> tuple[float, float]:
        nonlocal now
        now += TICK
        view = make_view(make_scan([30.0] * 361, now, math.tau), now=now, base=BASE)
        command, _ = layer.limit(Twist(Vector3(way * speed), Vector3(z=way * turn)), view)
        return way * command.linear.x, way * command.angular.z

    asked = [(0.25, 0.8)] * 3 + [(-0.3, -0.1)] * 4 + [(0.0, 0.0)] * 2
    speeds, turns = zip(*(step(*each) for each in asked), strict=True)
    assert speeds == pytest.approx((0.1, 0.2, 0.25, 0.05, -0.1, -0.2, -0.3, -0.1, 0.0))
    assert turns == pytest.approx((0.3, 0.6, 0.8, 0.5, 0.2, -0.1, -0.1, 0.0, 0.0))


def test_it_brakes_along_its_arc_where_speed_and_turn_cannot_follow_the_cut() -> None:
    """A wall comes up close before a base that can lose speed sooner than turn: both fall in one ratio, as hard as the
    limits let them, so the base stays on the arc whose way was free."""
    robot = Drive([], base=Base(acc_lim_x=1.5, decel_lim_x=-1.0, acc_lim_theta=1.0))
    for _ in range(12):
        robot.step(0.4, 1.0)
    pose, command = robot.pose, robot.command
    x, y, yaw = pose.compose(Pose2(0.3, 0.0, 0.0))
    robot.walls = [(x + math.sin(yaw), y - math.cos(yaw), x - math.sin(yaw), y + math.cos(yaw))]
    commands = [command]
    while robot.step(0.4, 1.0):
        commands.append(robot.command)
    speeds, turns = zip(*commands, strict=True)
    assert len(speeds) > 2
    assert turns == pytest.approx([2.5 * speed for speed in speeds])
    assert np.diff(turns) == pytest.approx(-0.1)


@pytest.mark.parametrize("turn", [0.004, 0.02])
def test_a_slow_turn_never_gets_to_the_wall_by_small_steps(turn: float) -> None:
    """A front corner, 6 mm from a wall, comes nearer by less than a millimetre a tick: it stops before the wall."""
    robot = Drive([(-0.6, 0.181, 0.6, 0.181)])
    for _ in range(400):
        robot.step(0.0, turn)
    assert robot.pose.yaw > 1e-3
    assert robot.pose.compose(Pose2(FRONT, 0.175, 0.0)).y < 0.181


class Straight(Behavior):
    """Straight on by the transforms."""

    uses_tf = True

    def step(self, view: View) -> Twist:
        """Half a metre a second."""
        return Twist(Vector3(SPEED))


class Follows(Straight):
    """Straight on, until the pose of robot 1 is old."""

    uses_tf = False

    def step(self, view: View) -> Twist:
        """Half a metre a second, or zero."""
        found = view.base_from_robot(1)
        self.reason = "" if found and view.is_fresh(found[1], 0.5) else "leader robot_1 not seen"
        return Twist() if self.reason else super().step(view)


@pytest.mark.parametrize(
    ("base", "braked"), [(Base(), [0.25, 0.0, 0.0, 0.0, 0.0]), (Base(decel_lim_x=-1.0), [0.4, 0.3, 0.2, 0.1, 0.0])]
)
@pytest.mark.parametrize("what", ["scan", "tf", "leader"])
def test_old_data_lets_it_brake_to_a_stand(what: str, base: Base, braked: list[float]) -> None:
    """When the scan, its own pose or its leader's is older than 0.5 s, it brakes step by step, as hard as its base can
    or at 2.5 m/s², and then stands."""
    behavior, layer = Follows(None) if what == "leader" else Straight(None), SafetyLayer()
    speeds, reasons = [], []
    for tick in range(14):
        now = START + tick * TICK
        scan = make_scan([30.0] * 271, START if what == "scan" else now)

        def look(target: str, source: str, now: int = now) -> tuple[Pose2, int]:
            is_old = what == ("leader" if source == names.robot_frame(1, names.BASE_FOOTPRINT) else "tf")
            return Pose2(0.0, 0.0, 0.0), START if is_old else now

        command, reason = decide(behavior, make_view(scan, now=now, base=base, lookup=look), layer)
        speeds.append(command.linear.x)
        reasons.append(reason)
    assert speeds == pytest.approx([SPEED] * 6 + braked + [0.0] * 3)
    expected = {"scan": "stale scan", "tf": "its own pose in map is stale", "leader": "leader robot_1 not seen"}
    assert reasons == [""] * 6 + [expected[what]] * 8


@pytest.mark.parametrize("tiny", [5e-324, 1e-181, 1e-9])
def test_the_smallest_velocities_are_none(tiny: float) -> None:
    """No step ends with an error because a velocity is next to nothing: there is nothing to divide by."""
    for wanted in (Twist(Vector3(tiny)), Twist(angular=Vector3(z=-tiny)), Twist(Vector3(-tiny), Vector3(z=tiny))):
        view = make_view(make_scan([0.3] * 271, START), now=START)
        assert SafetyLayer().limit(wanted, view)[0] == Twist()
