"""The safety layer in a closed loop with the simulator's core: bases of every kind come to a wall and touch it not."""

import math

import pytest
from msgspec.structs import replace

from support.small_worlds import LASER, drive, make_robot, make_world
from zteam.behaviors import SafetyLayer, View
from zteam.clock import NS_PER_S
from zteam.geometry import Pose2
from zteam.messages import Twist
from zteam.messages.base import base_of
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

    @property
    def x(self) -> float:
        """Metres along the way to the wall, of the origin."""
        return float(self.seen.robots[0].truth[0])

    def step(self, wanted: Twist) -> None:
        """A tick."""
        now, first = self.seen.stamp, self.seen.tick <= 1
        scan, odom = scan_message(self.seen, 0, 0), odometry_message(self.seen, 0)
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


@pytest.mark.few(6)
@pytest.mark.parametrize("angle", [0.3, 0.6, 0.9])
@pytest.mark.parametrize(("wall_at", "yaw", "straight"), [(2.0, 0.6, 0.0), (2.0, 0.0, 1.0), (3.0, 0.0, 1.0)])
@pytest.mark.parametrize(("wheelbase", "turning"), [(2.0, math.inf), (0.2, math.radians(2.0))])
def test_a_cars_own_limits_count(
    wheelbase: float, turning: float, angle: float, wall_at: float, yaw: float, straight: float
) -> None:
    """A car with 2 m from axle to axle, or one whose wheels turn by 2 °/s², turns in a wide arc, and not past the wall:
    so it stops before it."""
    limits = Limits((-1.0, 1.0), _FREE, (-turning, turning))
    robot = make_robot(yaw=yaw, drive="car", wheelbase=wheelbase, acceleration=limits, rangers=(ROUND,))
    loop = Loop(robot, wall_at=wall_at)
    loop.run(drive(1.0), straight)
    loop.run(drive(1.0, -angle), 12.0)
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


def test_without_the_layer_an_omni_base_moves_sideways_within_its_limits() -> None:
    """`--no-safety` leaves the limits of speed and nothing else; a base that is not omni does not move sideways."""
    limits = Limits((-1.0, 1.0), (-0.4, 0.4), (-1.0, 1.0))
    loop = Loop(make_robot(drive="omni", velocity=limits), has_layer=False)
    loop.step(drive(0.3, vy=0.9))
    assert (loop.left.linear.x, loop.left.linear.y) == (0.3, 0.4)
    loop = Loop(make_robot(velocity=limits), has_layer=False)
    loop.step(drive(0.3, vy=0.9))
    assert (loop.left.linear.x, loop.left.linear.y) == (0.3, 0.0)
