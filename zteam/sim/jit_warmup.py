"""`python -m zteam.sim.jit_warmup`: compiles all kernels of the simulator into the cache; a child of a simulator.

A tiny world that runs without numba shows what each kernel is called with.
"""

import math
import sys

import msgspec
import numpy as np

from zteam.compiling.kernels import Kernel
from zteam.compiling.warmup import warm_up
from zteam.geometry import Pose2
from zteam.messages import Twist, Vector3
from zteam.sim.cast_pair import WORTH
from zteam.sim.engine import Engine
from zteam.sim.jit import SIMULATOR
from zteam.simulation_options import PHYSICS, Options
from zteam.world.model import Floorplan, Obstacle, Ranger, Robot, Shape, World

_BOX = ((0.1, -0.1), (0.1, 0.1), (-0.1, 0.1), (-0.1, -0.1))


def find_kernels() -> list[Kernel]:
    """All kernels that are called from outside of kernels, each with a sample of its arguments."""
    SIMULATOR.use_plain()
    occupied = np.zeros((20, 20), bool)
    occupied[0] = True
    plan = Floorplan("floor", occupied, (0.1, 0.1), Pose2(-1.0, -1.0, 0.0), 0.0, 1.0)
    laser = Ranger("laser", 0.0, 0.0, 0.1, 0.0, math.pi, 40, 0.0, 5.0)
    # Few beams are cast on one thread, many on two.
    lasers = laser, msgspec.structs.replace(laser, samples=WORTH)
    body = (Shape(_BOX, 0.0, 0.2),)
    robots = tuple(Robot("r", "r", Pose2(0.3 * i, -0.75, -1.5), body, lasers) for i in range(2))
    world = World("tiny", 100_000_000, (plan,), (Obstacle("o", Pose2(0.0, 0.5, 0.0), body),), robots)
    for physics in PHYSICS:
        engine = Engine(world, options=Options(physics=physics, odom_alphas=(0.1, 0.1, 0.1, 0.1)))  # type: ignore[arg-type]
        # Into the wall, so that the kernels for what touches are used too.
        for _ in range(5):
            engine.step({0: Twist(Vector3(0.5)), 1: Twist(Vector3(0.5))})
    return [kernel for kernel in SIMULATOR.kernels if kernel.sample is not None]


if __name__ == "__main__":
    sys.exit(warm_up(find_kernels))
