"""Contacts: bodies stop each other, push, and enter no wall."""

import itertools
import math
from typing import Any, Literal

import numpy as np
import pytest

from support.pushing import rectangle
from support.small_worlds import drive, make_box, make_robot, make_world
from zteam.geometry import Pose2
from zteam.sim import Engine, Options
from zteam.simulator.world.model import Floorplan, Limits, Obstacle, Shape, World

Physics = Literal["dynamic", "stage", "kinematic"]
PHYSICS: tuple[Physics, ...] = ("dynamic", "stage", "kinematic")
QUARTERS = [k * math.pi / 2 for k in range(4)]
HORSESHOE = ((-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (0.6, 1.0), (0.6, -0.6), (-0.6, -0.6), (-0.6, 1.0), (-1.0, 1.0))


@pytest.mark.few(16)
@pytest.mark.parametrize("physics", PHYSICS)
@pytest.mark.parametrize(("mine", "its"), list(itertools.product(QUARTERS, QUARTERS)))
def test_aligned_bodies_of_one_size_stop_each_other(physics: Physics, mine: float, its: float) -> None:
    """A robot drives at its twin, edges exactly in line, from each side of either: it stops where they touch."""
    twin = make_robot(1.5 * math.cos(mine), 1.5 * math.sin(mine), its)
    engine = Engine(make_world(make_robot(yaw=mine), twin, wall_at=50.0), options=Options(physics=physics))
    for _ in range(40):
        engine.move({0: drive(0.5)})
    gap = math.dist(engine.truth(0)[:2], engine.truth(1)[:2]) - 0.4
    assert -0.005 < gap < 0.06
    assert physics == "dynamic" or engine.observe_bases().robots[0].stall


@pytest.mark.parametrize("physics", PHYSICS)
def test_a_robot_enters_a_horseshoe_and_stops_at_its_bottom(physics: Physics) -> None:
    """A body that is not convex has room in its hollow, and walls around it."""
    shoe = Obstacle("shoe", Pose2(0.0, 0.0, 0.0), (Shape(HORSESHOE, 0.0, 1.0),))
    world = make_world(make_robot(0.0, 2.0, -math.pi / 2), wall_at=50.0, others=(shoe,))
    engine = Engine(world, options=Options(physics=physics))
    for _ in range(80):
        engine.move({0: drive(0.5)})
    assert engine.truth(0).y == pytest.approx(-0.4, abs=0.06)
    assert engine.truth(0).x == pytest.approx(0.0, abs=0.01)


FAST = Limits(x=(-5.0, 5.0))


@pytest.mark.parametrize(("mass", "speed"), [(0.1, 1.0), (0.1, 5.0), (100.0, 5.0)])
def test_a_robot_that_pushes_a_box_against_a_wall_is_stopped_by_it(mass: float, speed: float) -> None:
    """A heavy robot presses a box against a wall: it stalls in front of the box, and the box stays between them."""
    box = make_box("box", 1.0, 0.0, 0.2, mass=mass)
    robot = make_robot(velocity=FAST, mass=100.0)
    engine = Engine(make_world(robot, wall_at=2.0, others=(box,)))
    for _ in range(40):
        engine.move({0: drive(speed)})
        assert engine.observe().pushed["box"].x < 2.0 - 0.1 + 0.015
        assert engine.truth(0).x + 0.2 < 2.0 - 0.2 + 0.04
    assert engine.observe_bases().robots[0].stall
    assert engine.truth(0).x + 0.2 > 2.0 - 0.2 - 0.05


def test_a_box_that_was_pressed_can_be_left_and_pushed_away() -> None:
    """What was pressed against a wall does not stick to it: a robot pushes it on along the wall."""
    box = make_box("box", 1.0, 0.0, 0.2, mass=1.0)
    pusher, other = make_robot(velocity=FAST, mass=50.0), make_robot(1.8, -1.5, math.pi / 2)
    engine = Engine(make_world(pusher, other, wall_at=2.0, others=(box,)))
    for _ in range(10):
        engine.move({0: drive(3.0)})
    for _ in range(20):
        engine.move({0: drive(-1.0)})
    for _ in range(20):
        engine.move({1: drive(1.0)})
    assert engine.observe().pushed["box"].y > 0.3


def _in_block(robot: Any, physics: str) -> Engine:
    block = Obstacle("block", Pose2(0.0, 0.0, 0.0), (Shape(rectangle(4.0, 4.0), 0.0, 1.0),))
    return Engine(make_world(robot, wall_at=50.0, others=(block,)), options=Options(physics=physics))  # type: ignore[arg-type]


def _in_bitmap(robot: Any, physics: str) -> Engine:
    plan = Floorplan("solid", np.ones((40, 40), bool), (0.1, 0.1), Pose2(-2.0, -2.0, 0.0), 0.0, 1.0)
    world = World("solid", 100_000_000, (plan,), (), (robot,))
    return Engine(world, options=Options(physics=physics))  # type: ignore[arg-type]


@pytest.mark.parametrize("physics", ["dynamic", "stage", "kinematic"])
@pytest.mark.parametrize("make", [_in_block, _in_bitmap])
@pytest.mark.parametrize("x", [0.0, 1.0])
def test_a_robot_in_a_wall_stalls_until_it_is_moved(physics: str, make: Any, x: float) -> None:
    """A robot that the world file puts into a wall neither drives nor turns; put beside it, it drives."""
    engine = make(make_robot(x, 0.0), physics)
    for _ in range(30):
        engine.move({0: drive(1.0, 1.0)})
        assert engine.truth(0) == Pose2(x, 0.0, 0.0)
        assert engine.observe_bases().robots[0].stall
    engine.place(0, Pose2(4.0, 0.0, 0.0))
    for _ in range(5):
        engine.move({0: drive(1.0)})
    assert engine.truth(0).x == pytest.approx(4.5)
    assert not engine.observe_bases().robots[0].stall
    engine.place(0, Pose2(0.5, 0.0, 0.0))
    engine.move({0: drive(1.0)})
    assert engine.truth(0).x == 0.5


def test_a_robot_that_was_put_into_a_wall_while_it_pressed_loses_no_step_when_it_is_free() -> None:
    """No force is left over from the wall, in which its mass is infinite."""
    engine = _in_block(make_robot(-2.5, 0.0), "dynamic")
    for x in (None, 0.0, 4.0):
        if x is not None:
            engine.place(0, Pose2(x, 0.0, 0.0))
        for _ in range(5):
            engine.move({0: drive(1.0)})
    assert engine.truth(0).x == pytest.approx(4.5)


def test_a_robot_smaller_than_its_way_does_not_leap_over_a_wall() -> None:
    """A robot of 4 cm at 5 m/s passes a wall of 2 cm in no step, though there is nothing to push."""
    wall = Obstacle("thin", Pose2(1.0, 0.0, 0.0), (Shape(rectangle(0.02, 4.0), 0.0, 1.0),))
    for k in range(20):
        tiny = make_robot(0.01 * k, 0.0, velocity=FAST, shapes=(Shape(rectangle(0.04, 0.04), 0.0, 0.3),))
        engine = Engine(make_world(tiny, wall_at=50.0, others=(wall,)))
        for _ in range(10):
            engine.move({0: drive(5.0)})
        assert 0.9 < engine.truth(0).x < 1.0


def test_boxes_that_overlap_at_first_come_apart() -> None:
    """Things that the world file puts into each other are not stuck: contacts part them."""
    boxes = make_box("one", 1.0, 0.0, mass=1.0), make_box("other", 1.1, 0.05, mass=1.0)
    engine = Engine(make_world(make_robot(-1.0), wall_at=5.0, others=boxes))
    for _ in range(20):
        engine.move({})
    pushed = engine.observe().pushed
    assert max(abs(pushed["one"].x - pushed["other"].x), abs(pushed["one"].y - pushed["other"].y)) > 0.38
