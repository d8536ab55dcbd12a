"""The safety layer in a closed loop with the simulator's core: bases of every kind come to a wall and touch it not."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from msgspec.structs import replace

from support.small_worlds import LASER, drive, make_robot, make_world
from zteam.behaviors import SafetyLayer, View
from zteam.clock import NS_PER_S
from zteam.geometry import Pose2
from zteam.messages import LaserScan, Twist
from zteam.messages.base import Base, base_of
from zteam.robot.safety.motion import limit_speed
from zteam.sim import Engine
from zteam.simulator.core.to_messages import odometry_message, scan_message
from zteam.simulator.world.model import Limits, Robot, World, base_info

ROUND = replace(LASER, fov=math.tau, samples=361)
"""A laser that looks all round."""
FRONT = 0.2
"""Metres from the square robot's origin to each of its sides."""
_FREE = (-math.inf, math.inf)


class Loop:
    """A robot in the simulator's core that asks for a velocity, and what is left of it."""

    def __init__(self, robot: Robot, *, wall_at: float = 3.0, tick: float = 0.1, has_layer: bool = True) -> None:
        world: World = replace(make_world(robot, wall_at=wall_at), interval=round(tick * NS_PER_S))
        self._engine, self._base, self._tick = Engine(world), base_of(base_info(robot)), tick
        self._layer = SafetyLayer() if has_layer else None
        self.seen = self._engine.step({})
        self.left = Twist()
        self.why = ""
        self.stalled = False
        self.driven = 0.0
        """Metres."""
        self.change: Callable[[LaserScan], None] = lambda scan: None
        """Done to each scan before the robot sees it."""

    @property
    def x(self) -> float:
        """Metres along the way to the wall, of the origin."""
        return float(self.seen.robots[0].truth[0])

    def step(self, wanted: Twist) -> None:
        """A tick."""
        now, first = self.seen.stamp, self.seen.tick <= 1
        scan, odom = scan_message(self.seen, 0, 0), odometry_message(self.seen, 0)
        scan.ranges = scan.ranges.copy()
        self.change(scan)
        view = View(
            now=now, dt=0.0 if first else self._tick, robot_id=0, scan=scan, odom=odom, base=self._base,
            lookup=lambda target, source: (Pose2(0.0, 0.0, 0.0), now),
        )  # fmt: skip
        self.left, self.why = self._layer.limit(wanted, view) if self._layer else limit_speed(wanted, view.base)
        before, self.seen = self.seen.robots[0].truth, self._engine.step({0: self.left})
        self.driven += math.dist(before[:2], self.seen.robots[0].truth[:2])
        self.stalled = self.stalled or self.seen.robots[0].stall

    def run(self, wanted: Twist, seconds: float) -> None:
        """So many simulated seconds of the same wish."""
        for _ in range(round(seconds / self._tick)):
            self.step(wanted)


def test_beams_that_fall_silent_keep_what_they_saw_where_it_was() -> None:
    """At full speed all beams fall silent 0.95 m before the wall: the wall stays where it is."""
    loop = Loop(make_robot(acceleration=Limits((-1.0, 1.5), _FREE, _FREE)))

    def silence(scan: LaserScan) -> None:
        if 3.0 - loop.x - FRONT <= 0.95:
            scan.ranges[:] = math.nan

    loop.change = silence
    loop.run(drive(1.0), 10.0)
    assert not loop.stalled
    assert 0.0 < 3.0 - loop.x - FRONT < 0.95


@pytest.mark.few(4)
@pytest.mark.parametrize("angle", [0.3, 0.6, 0.9])
@pytest.mark.parametrize(
    ("wall_at", "yaw", "straight"), [(2.0, 0.6, 0.0), (2.0, 0.0, 1.0), (3.0, 0.0, 1.0), (3.0, 0.6, 0.0)]
)
def test_a_cars_own_wheelbase_counts(angle: float, wall_at: float, yaw: float, straight: float) -> None:
    """A short car with 2 m from axle to axle turns in a wide arc, and not past the wall: so it stops before it."""
    limits = Limits((-1.0, 1.0), _FREE, _FREE)
    robot = make_robot(yaw=yaw, drive="car", wheelbase=2.0, acceleration=limits, rangers=(ROUND,))
    loop = Loop(robot, wall_at=wall_at)
    loop.run(drive(1.0), straight)
    loop.run(drive(1.0, -angle), 12.0)
    assert not loop.stalled
    assert loop.driven > 1.0


@pytest.mark.few(4)
@pytest.mark.parametrize("angle", [0.2, 0.5, 0.8])
@pytest.mark.parametrize(
    ("wall_at", "yaw", "straight"), [(2.0, 0.0, 0.0), (2.0, 0.0, 1.0), (3.0, 0.6, 0.0), (3.0, 0.6, 1.0)]
)
def test_a_cars_yaw_acceleration_counts(angle: float, wall_at: float, yaw: float, straight: float) -> None:
    """With 2 °/s² it hardly leaves its straight way when its wheels are turned: the wall there is what stops it."""
    turning = math.radians(2.0)
    limits = Limits((-1.0, 1.0), _FREE, (-turning, turning))
    robot = make_robot(yaw=yaw, drive="car", wheelbase=0.2, acceleration=limits, rangers=(ROUND,))
    loop = Loop(robot, wall_at=wall_at)
    loop.run(drive(1.0), straight)
    loop.run(drive(1.0, -angle), 15.0)
    assert not loop.stalled
    assert loop.driven > 1.0


@pytest.mark.parametrize("speed", [0.3, 0.6, 1.0])
def test_backwards_the_bound_for_braking_backwards_counts(speed: float) -> None:
    """A base that brakes with 2 m/s² forwards and 0.5 m/s² backwards comes to a wall behind it."""
    limits = Limits((-2.0, 0.5), _FREE, _FREE)
    loop = Loop(make_robot(yaw=math.pi, acceleration=limits, rangers=(ROUND,)))
    loop.run(drive(-speed), 15.0)
    assert not loop.stalled
    assert 0.1 < 3.0 - loop.x - FRONT < 0.4


@pytest.mark.few(9)
@pytest.mark.parametrize("tick", [0.6, 1.0, 2.0])
@pytest.mark.parametrize("speed", [0.3, 0.5, 0.7, 1.0])
@pytest.mark.parametrize("wall_at", [2.0, 3.1, 4.0])
def test_the_reaction_is_the_tick_however_long(tick: float, speed: float, wall_at: float) -> None:
    """With a command each second or two a base that brakes with 1 m/s² drives so slowly that it can stop in time."""
    limits = Limits((-1.0, 1.0), _FREE, (-3.0, 3.0))
    loop = Loop(make_robot(acceleration=limits), wall_at=wall_at, tick=tick)
    loop.run(drive(speed), 40.0)
    assert not loop.stalled
    assert loop.x > 0.8


@pytest.mark.ci
def test_a_base_that_is_faster_than_it_is_told_is_slowed_down_in_time() -> None:
    """Down a ramp it drives 1.6 times as fast as commanded, and odometry says so: what it really does counts."""
    base = Base(decel_lim_x=-1.0, acc_lim_x=1.0)
    layer, x, speed, now = SafetyLayer(), 0.0, 0.0, 10 * NS_PER_S
    angles = np.linspace(-math.pi / 2, math.pi / 2, 181)
    for _ in range(150):
        with np.errstate(divide="ignore"):
            ranges = np.minimum((4.0 - x) / np.cos(angles), 30.0)
        robot = replace(make_robot(x), rangers=(LASER,))
        seen = Engine(make_world(robot)).step({})
        scan, odom = scan_message(seen, 0, 0), odometry_message(seen, 0)
        scan = replace(scan, angle_min=angles[0], angle_increment=angles[1] - angles[0], range_max=30.0, ranges=ranges)
        scan.header.stamp.sec, scan.header.stamp.nanosec = divmod(now, NS_PER_S)
        odom.pose.pose.position.x, odom.twist.twist.linear.x = x, speed
        view = View(now=now, dt=0.1, robot_id=0, scan=scan, odom=odom, base=base, lookup=lambda target, source: None)
        left, _ = layer.limit(drive(1.0), view)
        goal = 1.6 * left.linear.x
        speed = max(goal, speed - 0.1) if goal < speed else min(goal, speed + 0.1)
        x, now = x + 0.1 * speed, now + NS_PER_S // 10
        assert x + 0.125 < 4.0
    assert x > 3.0


def test_an_omni_base_moves_sideways_and_stops_before_what_stands_there() -> None:
    """Where its laser looks all round, as fast as asked; else at 0.2 m/s at most, as backwards."""
    for laser, fastest in ((ROUND, 0.6), (LASER, 0.2)):
        loop = Loop(make_robot(yaw=-0.5 * math.pi, drive="omni", rangers=(laser,)))
        loop.step(drive(0.0, vy=0.6))
        loop.step(drive(0.0, vy=0.6))
        assert loop.left.linear.y == pytest.approx(fastest)
        loop.run(drive(0.0, vy=0.6), 20.0)
        assert not loop.stalled
        assert loop.why == "obstacle beside"
        assert 0.15 <= 3.0 - loop.x - FRONT < 0.25


def test_an_omni_base_moves_at_an_angle_too() -> None:
    """Forwards, sideways and in a turn at once: what the outline sweeps is looked at."""
    loop = Loop(make_robot(yaw=-0.5, drive="omni", rangers=(ROUND,)))
    loop.run(drive(0.5, 0.3, 0.4), 20.0)
    assert not loop.stalled
    assert loop.driven > 2.0


def test_without_the_layer_an_omni_base_moves_sideways_within_its_limits() -> None:
    """`--no-safety` leaves the limits of speed and nothing else; a base that is not omni does not move sideways."""
    limits = Limits((-1.0, 1.0), (-0.4, 0.4), (-1.0, 1.0))
    loop = Loop(make_robot(drive="omni", velocity=limits), has_layer=False)
    loop.step(drive(0.3, vy=0.9))
    assert (loop.left.linear.x, loop.left.linear.y) == (0.3, 0.4)
    loop = Loop(make_robot(velocity=limits), has_layer=False)
    loop.step(drive(0.3, vy=0.9))
    assert (loop.left.linear.x, loop.left.linear.y) == (0.3, 0.0)


def test_a_fast_base_drives_as_fast_as_it_can_and_stops() -> None:
    """The cap of 1 m/s is gone: a base of 2 m/s drives 2 m/s in the open, and stops before the wall."""
    limits = Limits((-1.0, 2.0), (0.0, 0.0), (-1.5, 1.5))
    accelerations = Limits((-1.0, 1.0), _FREE, _FREE)
    laser = replace(LASER, range_max=30.0)
    loop = Loop(make_robot(velocity=limits, acceleration=accelerations, rangers=(laser,)), wall_at=12.0)
    fastest = 0.0
    for _ in range(200):
        loop.step(drive(2.0))
        fastest = max(fastest, loop.left.linear.x)
    assert fastest == 2.0
    assert not loop.stalled
    assert 0.15 <= 12.0 - loop.x - FRONT < 0.3
