"""`python -m zteam.sim.jit_warmup`: compiles all kernels of the simulator into the cache; a child of a simulator.

A tiny world that runs without numba shows what each kernel is called with. Then one kernel is compiled after the other
and kept at once: what a process that ends early had finished is not lost.
"""

import argparse
import math
import os
import sys
import threading

import msgspec
import numpy as np

from zteam.geometry import Pose2
from zteam.messages import Twist, Vector3
from zteam.sim import jit, kernel_cache
from zteam.sim.cast_pair import WORTH
from zteam.sim.engine import Engine
from zteam.sim.takeover import FAILED
from zteam.simulation_options import PHYSICS, Options
from zteam.world.model import Floorplan, Obstacle, Ranger, Robot, Shape, World

_NICE = 10
"""A process beside a running simulator gets about a tenth of the time that the others do."""
_BOX = ((0.1, -0.1), (0.1, 0.1), (-0.1, 0.1), (-0.1, -0.1))


def find_kernels() -> list[jit.Kernel]:
    """All kernels that are called from outside of kernels, each with a sample of its arguments."""
    jit.use_plain()
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
    return [kernel for kernel in jit.KERNELS if kernel.sample is not None]


def _end_with_parent() -> None:
    # The simulator holds the other end: this reads nothing until that process is gone, however it went.
    os.read(sys.stdin.fileno(), 1)
    os._exit(1)


def _compile(*, backwards: bool) -> None:
    kernels = find_kernels()
    for kernel in reversed(kernels) if backwards else kernels:
        kernel.compile()
        kernel.keep()
        _tell(f"{len(kernels)} {kernel.name} {kernel.dispatcher.stats.cache_path}")


def _tell(line: str) -> None:
    sys.stdout.write(line + "\n")
    sys.stdout.flush()


def main() -> int:
    """Entry point. Writes a line for every kernel that is ready: how many there are, its name, and its folder."""
    parser = argparse.ArgumentParser(prog="zteam.sim.jit_warmup", description=__doc__)
    parser.add_argument("--nice", action="store_true", help="give way to other processes")
    parser.add_argument("--backwards", action="store_true", help="begin at the end, where another begins at the start")
    args = parser.parse_args()
    if args.nice:
        os.nice(_NICE)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    try:
        _compile(backwards=args.backwards)
    except OSError as error:
        _tell(f"{FAILED}{kernel_cache.FOLDER}: {error.strerror}")
        return 1
    except Exception as error:
        # The simulator says so and goes on without.
        _tell(f"{FAILED}{type(error).__name__}: {str(error).partition(chr(10))[0]}")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
