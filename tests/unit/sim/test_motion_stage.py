"""Velocities in Stage's way of stepping, and of accelerating cars."""

import math

import pytest

from support.small_worlds import drive, make_robot, make_world
from zteam.sim import Engine, Options
from zteam.world.model import Limits


def test_a_diff_drive_has_no_sideways_speed_in_stages_steps() -> None:
    """Stage steps along the old heading: the twist is what was commanded, with nothing sideways, and wheels agree."""
    engine = Engine(make_world(make_robot(), wall_at=50.0), options=Options(physics="stage"))
    for _ in range(5):
        seen = engine.step({0: drive(0.5, 1.0)}).robots[0]
    assert seen.velocity == pytest.approx((0.5, 0.0, 1.0), abs=1e-9)
    left, right = seen.joints.velocities
    assert (left + right) / 2 * 0.05 == pytest.approx(0.5, abs=1e-9)


def test_errors_of_zero_leave_stages_odometry_true() -> None:
    """Odometry that is integrated with a bias of next to nothing follows the truth in Stage's steps too."""
    robot = make_robot(localization="odom", odom_error=(1e-15, 0.0, 0.0))
    engine = Engine(make_world(robot, wall_at=50.0), options=Options(physics="stage"))
    for _ in range(50):
        seen = engine.step({0: drive(0.5, 1.0)}).robots[0]
    assert seen.odom == pytest.approx(seen.truth, abs=1e-9)


def test_a_car_that_gathers_speed_follows_its_wheels() -> None:
    """From rest, at speed and to rest again, a car with limited acceleration never turns more sharply than steered."""
    limits = Limits(x=(-0.5, 0.5), y=(-1.0, 1.0), yaw=(-1.0, 1.0))
    engine = Engine(make_world(make_robot(drive="car", acceleration=limits), wall_at=50.0))
    bends = []
    for tick in range(60):
        v, _, w = engine.step({0: drive(0.8, 0.5)} if tick < 30 else {}).robots[0].velocity
        bends.append(w / v if abs(v) > 1e-9 else 0.0)
        assert abs(w) <= abs(v) * math.tan(0.5) + 1e-9
    assert bends[25] == pytest.approx(math.tan(0.5))
    assert bends[-1] == 0.0
