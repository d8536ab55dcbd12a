"""Bodies that must not go through each other, whatever their shapes and however they are aligned."""

import itertools
import math
from typing import Literal

import numpy as np
import pytest

from support.small_worlds import BODY, drive, make_robot, make_world
from zteam.geometry import Pose2
from zteam.sim import Engine, Options
from zteam.world.model import Limits, Obstacle, Shape

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
    assert physics == "dynamic" or engine.standing().stalled[0]


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


def _apart(one: np.ndarray, other: np.ndarray) -> bool:
    """Whether an edge of one of two squares, corners (4, 2), has the other on its outer side."""
    for a, b in ((one, other), (other, one)):
        edges = a - np.roll(a, 1, axis=0)
        for (ex, ey), (x, y) in zip(edges, a, strict=True):
            if (ex * (b[:, 1] - y) - ey * (b[:, 0] - x) <= 1e-6).all():
                return True
    return False


@pytest.mark.ci
def test_bodies_on_long_arms_stop_each_other() -> None:
    """A turn swings a body that is far from its centre of rotation by metres: none of a crowd ends in another."""
    arm = 20.0
    body = np.array([(x + arm, y) for x, y in BODY])
    random = np.random.default_rng(4)
    robots = []
    for k in range(48):
        yaw = k * math.tau / 48
        centre = 0.6 * random.standard_normal(2)
        shapes = (Shape(tuple((float(x), float(y)) for x, y in body), 0.0, 0.3),)
        robots.append(make_robot(*centre, yaw, shapes=shapes, rangers=(), velocity=Limits(yaw=(-4.0, 4.0))))
    engine = Engine(make_world(*robots, wall_at=90.0), options=Options(physics="kinematic"))

    def corners(i: int) -> np.ndarray:
        x, y, yaw = engine.truth(i)
        turn = np.array(((math.cos(yaw), math.sin(yaw)), (-math.sin(yaw), math.cos(yaw))))
        return np.asarray(body @ turn + (x, y))

    for _ in range(40):
        engine.move({i: drive(0.0, float(random.uniform(-4.0, 4.0))) for i in range(48)})
        squares = [corners(i) for i in range(48)]
        assert all(_apart(one, other) for one, other in itertools.combinations(squares, 2))
