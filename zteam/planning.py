"""Navigation without a bus: maps and scans in; paths, poses and velocities out. docs/planning.md shows how."""

from zteam.geometry import Velocity
from zteam.navigation.planning.amcl import Amcl, AmclOptions
from zteam.navigation.planning.controller import (
    BlockedError,
    Controller,
    GoalChecker,
    GoalOptions,
    ProgressChecker,
    ProgressOptions,
    PursuitOptions,
    RegulatedPurePursuit,
    time_to_collision,
)
from zteam.navigation.planning.costmap import (
    Costmap,
    CostmapOptions,
    Footprint,
    make_circle,
    make_costmap,
    make_footprint,
)
from zteam.navigation.planning.grid import GridGeometry, GridMap, make_map
from zteam.navigation.planning.maps import read_map, write_map
from zteam.navigation.planning.parameters import make_controller, make_planner, read_options
from zteam.navigation.planning.planner import AStarOptions, AStarPlanner, NoPathError, Plan, Planner
from zteam.navigation.planning.recovery import Recovery, RecoveryOptions
from zteam.navigation.planning.scans import Scan, Teammate

__all__ = [  # noqa: RUF022 - in the order of the imports
    "Amcl", "AmclOptions", "GoalChecker", "GoalOptions", "ProgressChecker", "ProgressOptions", "Velocity",
    "time_to_collision", "BlockedError", "Controller", "PursuitOptions", "RegulatedPurePursuit",
    "Costmap", "CostmapOptions", "make_costmap", "Footprint", "make_circle", "make_footprint", "GridGeometry",
    "GridMap", "make_map", "read_map", "write_map", "read_options", "AStarOptions", "AStarPlanner",
    "NoPathError", "Plan", "Planner", "make_controller", "make_planner", "Recovery", "RecoveryOptions", "Scan",
    "Teammate",
]  # fmt: skip
