"""Compiles every kernel of the simulator by using it once on a tiny world."""

import math
from collections.abc import Callable

import numpy as np

from zteam.geometry import Pose2
from zteam.messages import Twist, Vector3
from zteam.sim.engine import Engine
from zteam.simulation import PHYSICS, Options
from zteam.world.model import Floorplan, Obstacle, Ranger, Robot, Shape, World

_BOX = ((0.1, -0.1), (0.1, 0.1), (-0.1, 0.1), (-0.1, -0.1))


def compile_kernels(report: Callable[[int, int], None]) -> None:
    """Bring all kernels into numba's cache; `report` is told (step, steps) before each step."""
    occupied = np.zeros((20, 20), bool)
    occupied[0] = True
    plan = Floorplan("floor", occupied, (0.1, 0.1), Pose2(-1.0, -1.0, 0.0), 0.0, 1.0)
    laser = Ranger("laser", 0.0, 0.0, 0.1, 0.0, math.pi, 40, 0.0, 5.0)
    body = (Shape(_BOX, 0.0, 0.2),)
    robots = tuple(Robot("r", "r", Pose2(0.3 * i, -0.75, -1.5), body, (laser,)) for i in range(2))
    world = World("tiny", 100_000_000, (plan,), (Obstacle("o", Pose2(0.0, 0.5, 0.0), body),), robots)
    for number, physics in enumerate(PHYSICS, 1):
        report(number, len(PHYSICS))
        engine = Engine(world, options=Options(physics=physics, odom_alphas=(0.1, 0.1, 0.1, 0.1)))  # type: ignore[arg-type]
        # Into the wall, so that the kernels for what touches are used too.
        for _ in range(5):
            engine.step({0: Twist(Vector3(0.5)), 1: Twist(Vector3(0.5))})
