"""`python -m zteam.planning.jit_warmup`: compiles all kernels of navigation into the cache; a child of a process.

A tiny map on which a robot plans, looks and drives without numba shows what each kernel is called with.
"""

import math
import sys

import numpy as np

from zteam.compiling.kernels import Kernel
from zteam.compiling.warmup import warm_up
from zteam.geometry import Pose2
from zteam.planning.amcl import Amcl
from zteam.planning.amcl_options import AmclOptions
from zteam.planning.collisions import Velocity, stands_free
from zteam.planning.controller import RegulatedPurePursuit
from zteam.planning.costmap import make_costmap
from zteam.planning.footprint import make_circle
from zteam.planning.grid import make_map
from zteam.planning.jit import PLANNING
from zteam.planning.planner import AStarPlanner
from zteam.planning.scans import Scan
from zteam.planning.search import Field

_SIZE = 40


def find_kernels() -> list[Kernel]:
    """All kernels that are called from outside of kernels, each with a sample of its arguments."""
    PLANNING.use_plain()
    cells = np.zeros((_SIZE, _SIZE), np.int8)
    cells[0], cells[_SIZE // 2, : _SIZE // 2] = 100, 100
    grid = make_map(cells, 0.1)
    scan = Scan(np.full(8, 1.0, np.float32), -math.pi, math.tau / 8, 0.0, 5.0, Pose2(0.0, 0.0, 0.0))
    start, goal = Pose2(0.5, 1.0, 0.0), Pose2(0.5, 3.5, 0.0)
    costmap = make_costmap(grid, make_circle(0.2))
    costmap.observe(scan, start)
    costmap.update()
    stands_free(costmap, start)
    plan = AStarPlanner().plan(costmap, start, goal)
    controller = RegulatedPurePursuit()
    controller.set_path(plan.path)
    controller.command(costmap, start, Velocity(), 0.1)
    field = Field(*cells.shape)
    field.set_free(cells == 0)
    way = field.find_way((1, 1), (_SIZE - 1, 1))
    assert way is not None
    field.cost_of(way)
    localiser = Amcl(grid, AmclOptions(min_particles=10, max_particles=20, global_particles=50))
    localiser.set_pose(start)
    localiser.update(start, scan)
    localiser.localize_globally()
    localiser.update(start, scan)
    return [kernel for kernel in PLANNING.kernels if kernel.sample is not None]


if __name__ == "__main__":
    sys.exit(warm_up(find_kernels))
