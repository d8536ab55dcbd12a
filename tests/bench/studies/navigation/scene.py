"""A world as navigation sees it, and ways through it that depend on a seed alone."""

import math
from collections.abc import Callable, Iterator
from typing import NamedTuple

import msgspec
import numpy as np

from zteam.clock import NS_PER_S
from zteam.counter_random import uniform
from zteam.errors import UsageError
from zteam.geometry import Pose2
from zteam.messages import Twist
from zteam.navigation.planning.costmap import Costmap, CostmapOptions, Footprint, make_costmap, make_footprint
from zteam.navigation.planning.grid import GridMap, make_map
from zteam.navigation.planning.planner import AStarPlanner, NoPathError, Plan
from zteam.navigation.planning.scans import Scan
from zteam.robot.behaviors.wander import Wander, WanderParams
from zteam.robot.view import View
from zteam.sim import Engine, Options
from zteam.simulator.core import RobotObservation
from zteam.simulator.core.occupancy_grid import map_message
from zteam.simulator.core.to_messages import odometry_message, scan_message
from zteam.simulator.world.model import base_info
from zteam.world import Ranger, Robot, World, add_robot

BEAMS, FOV, RANGE = 1081, math.radians(270.25), 30.0
ALPHAS = (0.2, 0.2, 0.2, 0.2)
_ATTEMPTS = 100_000


class NavFigure(msgspec.Struct):
    """One figure of the study `nav`."""

    what: str
    value: float
    unit: str
    must: float | None = None
    """At most this; for shares, at least."""
    detail: str = ""


Progress = Callable[[str, int, int], None]


class Way(NamedTuple):
    """Two poses, and the plan from one to the other."""

    start: Pose2
    goal: Pose2
    plan: Plan


def find_map(world: World, resolution: float) -> GridMap:
    """The map of all that stands still, as the simulator publishes it."""
    message = map_message(world, resolution)
    origin = Pose2(message.info.origin.position.x, message.info.origin.position.y, 0.0)
    cells = np.asarray(message.data, np.int8).reshape(message.info.height, message.info.width)
    return make_map(cells, resolution, origin)


def make_robot(world: World, pose: Pose2) -> Robot:
    """An erratic with the laser of the lectures."""
    robot = add_robot(world, "erratic", pose, "bench")
    laser = Ranger("laser", 0.05, 0.0, 0.16, 0.0, FOV, BEAMS, 0.0, RANGE)
    return msgspec.structs.replace(robot, rangers=(laser,))


def outline_of(robot: Robot) -> Footprint:
    """Its footprint."""
    return make_footprint([(point.x, point.y) for point in base_info(robot).footprint.points])


def scan_of(robot: RobotObservation) -> Scan:
    """What its first laser saw."""
    laser = robot.robot.rangers[0]
    return Scan(
        robot.readings[0].ranges, -0.5 * laser.fov, laser.angle_increment, laser.range_min, laser.range_max,
        Pose2(laser.x, laser.y, laser.yaw),
    )  # fmt: skip


def costmap_of(grid: GridMap, footprint: Footprint) -> Costmap:
    """A costmap with the inflation of the lectures."""
    return make_costmap(grid, footprint, CostmapOptions(inflation_radius=0.55, cost_scaling_factor=10.0))


def find_ways(costmap: Costmap, count: int, least: float, most: float = math.inf, *, seed: int = 1) -> list[Way]:
    """`count` ways between free cells, `least` to `most` metres long. Raises UsageError if there are too few."""
    free = np.argwhere(costmap.costs == 0)
    planner, found = AStarPlanner(), list[Way]()
    for draw in range(_ATTEMPTS if len(free) else 0):
        cells = [free[int(uniform(seed, draw, end) * len(free))].tolist() for end in (0, 1)]
        (x0, y0), (x1, y1) = (costmap.frame.centre_of(*cell) for cell in cells)
        if math.hypot(x1 - x0, y1 - y0) > most:
            continue
        start, goal = (
            Pose2(x, y, math.tau * uniform(seed, draw, end) - math.pi) for end, (x, y) in ((2, (x0, y0)), (3, (x1, y1)))
        )
        try:
            plan = planner.plan(costmap, start, goal)
        except NoPathError:
            continue
        if least <= plan.length <= most:
            found.append(Way(start, goal, plan))
            if len(found) == count:
                return found
    raise UsageError(f"this world has no {count} ways of {least:g} m and more: found {len(found)}")


def find_starts(costmap: Costmap, count: int, *, seed: int = 1) -> list[Pose2]:
    """`count` free poses from which at least 15 m of way can be driven."""
    return [way.start for way in find_ways(costmap, count, 15.0, seed=seed)]


def wander(world: World, start: Pose2, seconds: float, seed: int) -> Iterator[RobotObservation]:
    """A robot whose odometry errs by ALPHAS wanders from `start` in the simulator's core: each tick's observation."""
    engine = Engine(world, seed=seed, robots={0: make_robot(world, start)}, options=Options(odom_alphas=ALPHAS))
    behavior, command, before = Wander(WanderParams()), Twist(), 0
    for _ in range(int(seconds * NS_PER_S / world.interval)):
        seen = engine.step({0: command})
        yield seen.robots[0]
        view = View(
            now=seen.stamp,
            dt=(seen.stamp - before) / NS_PER_S if before else 0.0,
            robot_id=0,
            scan=scan_message(seen, 0, 0),
            odom=odometry_message(seen, 0),
            lookup=lambda _target, _source: None,
            team=(0,),
            seed=seed,
        )
        command, before = behavior.step(view) or Twist(), seen.stamp
