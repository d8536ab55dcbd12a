"""What a world's robot tells of its base."""

import math

import pytest

from support.world_texts import LoadText
from zteam.messages import BaseInfo
from zteam.simulator.world.model import base_info, footprint


def test_the_footprint_is_the_hull_of_all_that_collides(load: LoadText) -> None:
    """Body and children count at whatever height, about the centre of rotation; what does not collide does not."""
    child = "model ( size [0.2 0.1 0.1] pose [{x} 0 0 0] obstacle_return {solid} )"
    nose, antenna = child.format(x=0.4, solid=1), child.format(x=-0.9, solid=0)
    (robot,) = load(f"position ( size [0.4 0.4 0.2] origin [-0.1 0 0 0] {nose} {antenna} )", "").robots
    corners = [(-0.3, -0.2), (0.1, -0.2), (0.5, -0.05), (0.5, 0.05), (0.1, 0.2), (-0.3, 0.2)]
    assert footprint(robot) == tuple(pytest.approx(corner) for corner in corners)


def test_a_robot_that_nothing_collides_with_has_its_outline_all_the_same(load: LoadText) -> None:
    """The outline is then that of all shapes; a robot without a body has none."""
    ghost, point = load("position ( size [1 1 1] obstacle_return 0 )\nposition ( size [0 0 0] )", "").robots
    assert len(footprint(ghost)) == 4
    assert footprint(point) == ()


def test_limits_have_navs_names(load: LoadText) -> None:
    """Bounds along x both ways, about z the smaller one of left and right; without bounds there is no limit."""
    text = "velocity_bounds [-0.5 0.7 -9 9 0 0 -90 180] acceleration_bounds [-3 1 0 0 0 0 -180 90]"
    bounded, free = load(f'define cart position ( drive "omni" {text} )\ncart ()\nposition ()', "").robots
    info = base_info(bounded)
    assert (info.model, info.drive, info.min_vel_x, info.max_vel_x) == ("cart", "omni", -0.5, 0.7)
    assert (info.decel_lim_x, info.acc_lim_x) == (-3.0, 1.0)
    assert (info.max_vel_theta, info.acc_lim_theta) == pytest.approx((math.pi / 2, math.pi / 2))
    assert (info.max_vel_y, info.decel_lim_reverse, info.wheelbase) == (9.0, 1.0, 0.0)
    info = base_info(free)
    assert (info.acc_lim_x, info.decel_lim_x, info.acc_lim_theta) == (math.inf, -math.inf, math.inf)
    assert (info.max_vel_y, info.acc_lim_y, info.decel_lim_reverse) == (0.0, math.inf, math.inf)
    assert isinstance(info, BaseInfo)


def test_only_a_car_has_a_wheelbase(load: LoadText) -> None:
    """It is the one of the world file."""
    car, cart = load('position ( drive "car" wheelbase 1.7 )\nposition ( wheelbase 1.7 )', "").robots
    assert (base_info(car).wheelbase, base_info(cart).wheelbase) == (1.7, 0.0)
