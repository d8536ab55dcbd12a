"""What a car does of a velocity that only another base can drive."""

import math
from itertools import pairwise

import pytest
from msgspec.structs import replace

from support import flat_floor
from support.flat_floor import TICK, make_odometry, make_view
from zteam.geometry import Pose2, Velocity
from zteam.messages import Twist, Vector3
from zteam.messages.base import DEFAULT_BASE
from zteam.robot.behaviors.steering import Steering
from zteam.robot.safety.motion import limits_of


def move(at: Pose2, motion: Velocity, seconds: float) -> Pose2:
    """Where a base is that keeps a motion."""
    return flat_floor.drive(at, Twist(Vector3(motion.x), Vector3(z=motion.turn)), seconds)


CAR = replace(DEFAULT_BASE, drive="car", wheelbase=0.4)


def drive(wanted: Twist, seconds: float, walls: tuple[float, float] = (-math.inf, math.inf)) -> list[Pose2]:
    """The way of a car that cannot get past x = `walls`; no command turns its wheels by more than 45 degrees."""
    steering, at, way = Steering(), Pose2(0.0, 0.0, 0.0), []
    for tick in range(1, round(seconds * 10)):
        command = steering.drive(make_view(now=tick * TICK, base=CAR, odom=make_odometry(at)), wanted)
        assert abs(command.angular.z) < math.radians(45.1)
        motion = limits_of(CAR).motion_of(command)
        assert motion is not None
        ahead = move(at, motion, 0.1)
        at = ahead if walls[0] < ahead.x < walls[1] else at
        way.append(at)
    return way


@pytest.mark.parametrize("acceleration", [math.inf, 0.5, 0.2, 0.1])
@pytest.mark.parametrize(("x", "first"), [(0.0, 1.0), (0.01, 1.0), (-0.3, -1.0)])
def test_a_base_that_gains_speed_slowly_turns(acceleration: float, x: float, first: float) -> None:
    """In few moves, however slow it is to be; the first one goes the way that is wanted."""
    car = replace(CAR, acc_lim_x=acceleration, decel_lim_x=-acceleration)
    steering, at, motion, gears, turned = Steering(), Pose2(0.0, 0.0, 0.0), Velocity(), [], 0.0
    for tick in range(1, 600):
        view = make_view(now=tick * TICK, base=car, odom=make_odometry(at))
        command = steering.drive(view, Twist(Vector3(x), Vector3(z=1.0)))
        gears.append(math.copysign(1.0, command.linear.x))
        wanted = limits_of(car).motion_of(command)
        assert wanted is not None
        speed = max(motion.x - 0.1 * acceleration, min(motion.x + 0.1 * acceleration, wanted.x))
        motion = Velocity(speed, turn=wanted.turn * speed / wanted.x)
        at, turned = move(at, motion, 0.1), turned + 0.1 * motion.turn
    assert gears[0] == first
    assert sum(a != b for a, b in pairwise(gears)) < 30
    assert turned > 2.0 * math.pi


def test_a_bend_that_it_can_drive_is_driven() -> None:
    """The same speed and the same turn rate, forward and back."""
    for speed in (0.4, -0.4):
        end = drive(Twist(Vector3(speed), Vector3(z=0.3)), 2.1)[-1]
        assert tuple(end) == pytest.approx(tuple(move(Pose2(0.0, 0.0, 0.0), Velocity(speed, 0.0, 0.3), 2.0)), abs=1e-6)


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("walls", [(-math.inf, math.inf), (-0.3, 0.3)])
def test_a_turn_on_the_spot_takes_several_moves(side: float, walls: tuple[float, float]) -> None:
    """Forward and back, also between two walls, and it stays near the place."""
    way = drive(Twist(angular=Vector3(z=side)), 5.0, walls)
    assert side * way[-1].yaw > 0.25 * math.pi
    assert max(math.hypot(at.x, at.y) for at in way) < 1.0
    assert min(b.x - a.x for a, b in pairwise(way)) < 0.0
