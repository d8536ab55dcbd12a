"""Bodies that must not go through each other, whatever their shapes and however they are aligned."""

import itertools
import math
from typing import Literal

import pytest

from scenes import drive, make_robot, make_world
from zteam.geometry import Pose2
from zteam.sim import Engine, Options
from zteam.world.model import Obstacle, Shape

Physics = Literal["dynamic", "stage", "kinematic"]
PHYSICS: tuple[Physics, ...] = ("dynamic", "stage", "kinematic")
QUARTERS = [k * math.pi / 2 for k in range(4)]
HORSESHOE = ((-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (0.6, 1.0), (0.6, -0.6), (-0.6, -0.6), (-0.6, 1.0), (-1.0, 1.0))


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
    assert physics == "dynamic" or engine.stalled(0)


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
