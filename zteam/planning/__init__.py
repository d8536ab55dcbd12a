"""Navigation without a bus: maps and scans in; paths, poses and velocities out. docs/planning.md shows how."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from zteam.planning.amcl import Amcl
    from zteam.planning.amcl_options import AmclOptions
    from zteam.planning.checkers import GoalChecker, GoalOptions, ProgressChecker, ProgressOptions
    from zteam.planning.collisions import Velocity, stands_free, time_to_collision
    from zteam.planning.controller import BlockedError, Controller, PursuitOptions, RegulatedPurePursuit
    from zteam.planning.costmap import Costmap, CostmapOptions, make_costmap
    from zteam.planning.footprint import Footprint, make_circle, make_footprint
    from zteam.planning.grid import Frame, GridMap, make_map
    from zteam.planning.map_files import read_map, write_map
    from zteam.planning.options import read_options
    from zteam.planning.planner import AStarOptions, AStarPlanner, NoPathError, Plan, Planner
    from zteam.planning.plugins import make_controller, make_planner
    from zteam.planning.recovery import Recovery, RecoveryOptions
    from zteam.planning.scans import Scan, Teammate

_MODULES = {
    "amcl": ("Amcl",),
    "amcl_options": ("AmclOptions",),
    "checkers": ("GoalChecker", "GoalOptions", "ProgressChecker", "ProgressOptions"),
    "collisions": ("Velocity", "stands_free", "time_to_collision"),
    "controller": ("BlockedError", "Controller", "PursuitOptions", "RegulatedPurePursuit"),
    "costmap": ("Costmap", "CostmapOptions", "make_costmap"),
    "footprint": ("Footprint", "make_circle", "make_footprint"),
    "grid": ("Frame", "GridMap", "make_map"),
    "map_files": ("read_map", "write_map"),
    "options": ("read_options",),
    "planner": ("AStarOptions", "AStarPlanner", "NoPathError", "Plan", "Planner"),
    "plugins": ("make_controller", "make_planner"),
    "recovery": ("Recovery", "RecoveryOptions"),
    "scans": ("Scan", "Teammate"),
}
_HOME = {name: module for module, names in _MODULES.items() for name in names}

__all__ = [  # noqa: RUF022 - as the table above
    "Amcl", "AmclOptions", "GoalChecker", "GoalOptions", "ProgressChecker", "ProgressOptions", "Velocity",
    "stands_free", "time_to_collision", "BlockedError", "Controller", "PursuitOptions", "RegulatedPurePursuit",
    "Costmap", "CostmapOptions", "make_costmap", "Footprint", "make_circle", "make_footprint", "Frame", "GridMap",
    "make_map", "read_map", "write_map", "read_options", "AStarOptions", "AStarPlanner", "NoPathError", "Plan",
    "Planner", "make_controller", "make_planner", "Recovery", "RecoveryOptions", "Scan", "Teammate",
]  # fmt: skip


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'zteam.planning' has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(f"zteam.planning.{_HOME[name]}"), name)
