"""The pure cores need nothing that only Unix has."""

import subprocess
import sys

import pytest

from support.limits import LIMIT

CODE = """
import sys
sys.modules["fcntl"] = sys.modules["resource"] = sys.modules["termios"] = None
import pkgutil
import numpy as np
import zteam.navigation.planning
import zteam.planning
from zteam.geometry import Pose2
from zteam.config.resources import find_world
from zteam.sim import Engine
from zteam.world import load_world
seen = Engine(load_world(find_world("office"))).step({})
assert seen.robots[0].readings[0].ranges.min() > 0.0
for module in pkgutil.iter_modules(zteam.navigation.planning.__path__, "zteam.navigation.planning."):
    __import__(module.name)
grid = zteam.planning.make_map(np.zeros((40, 40), np.int8), 0.1)
costmap = zteam.planning.make_costmap(grid, zteam.planning.make_circle(0.2))
plan = zteam.planning.AStarPlanner().plan(costmap, Pose2(0.5, 0.5, 0.0), Pose2(3.5, 3.5, 0.0))
assert len(plan.path) > 1
"""


@pytest.mark.ci
def test_simulator_and_navigation_run_without_modules_of_unix() -> None:
    """An engine makes a tick, and a planner finds a path, where fcntl, resource and termios are missing."""
    done = subprocess.run(
        [sys.executable, "-P", "-c", CODE], capture_output=True, text=True, timeout=3 * LIMIT, check=False
    )
    assert done.returncode == 0, done.stderr
