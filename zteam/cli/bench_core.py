"""The simulator's core alone, as fast as it runs: wandering robots that start at seeded free poses."""

import math
import resource

import msgspec
import numpy as np

from zteam.clock import process_time
from zteam.counter_random import uniform
from zteam.errors import UsageError
from zteam.geometry import Pose2
from zteam.messages import Twist, Vector3
from zteam.sim import Engine, Options
from zteam.sim.casting import is_occupied
from zteam.world import Ranger, Robot, World, add_robot

_CLEARANCE = 0.35
"""Radius in metres around a start pose that has to be free."""
_TURN_TICKS = 20
"""Ticks after which a wandering robot chooses a new turn rate."""


class SimulationFigures(msgspec.Struct):
    """Figures per CPU second of this process, which other load affects little."""

    robots: int
    beams: int
    seconds: float
    rtf: float
    """Simulated seconds per CPU second."""
    rays_per_s: float
    step_ms: float
    rss_mb: float
    """Peak resident memory of the process, 10⁶ bytes."""


def measure_simulation(
    world: World,
    robots: int,
    beams: int,
    fov_deg: float,
    range_max: float,
    seconds: float,
    options: Options,
    seed: int = 1,
) -> SimulationFigures:
    """Run `robots` robots with a laser of `beams` beams for `seconds` simulated seconds."""
    laser = Ranger("laser", 0.05, 0.0, 0.16, 0.0, math.radians(fov_deg), beams, 0.0, range_max)
    team = {i: _robot(world, i, pose, laser) for i, pose in enumerate(free_poses(world, robots, seed))}
    engine = Engine(world, seed=seed, robots=team, options=options)
    ticks = max(1, round(seconds * 1e9 / world.interval))
    engine.step({})
    begin = process_time()
    commands: dict[int, Twist] = {}
    for tick in range(ticks):
        if tick % _TURN_TICKS == 0:
            commands = {i: _wander(seed, i, tick) for i in team}
        engine.step(commands)
    spent = max(process_time() - begin, 1e-9)
    return SimulationFigures(
        robots=robots,
        beams=beams,
        seconds=ticks * world.interval / 1e9,
        rtf=ticks * world.interval / 1e9 / spent,
        rays_per_s=ticks * robots * beams / spent,
        step_ms=1e3 * spent / ticks,
        rss_mb=resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e6,
    )


def _robot(world: World, number: int, pose: Pose2, laser: Ranger) -> Robot:
    robot = add_robot(world, "erratic", pose, f"bench_{number}")
    return msgspec.structs.replace(robot, rangers=(laser,))


def _wander(seed: int, robot: int, tick: int) -> Twist:
    turn = 2.0 * uniform(seed, robot, tick // _TURN_TICKS, 0) - 1.0
    return Twist(Vector3(0.4), Vector3(0.0, 0.0, turn))


def free_poses(world: World, count: int, seed: int) -> list[Pose2]:
    """Poses within the world's bounds with free space around them; they depend only on the seed."""
    corners = [corner for plan in world.floorplans for corner in _corners(plan.pose, plan.occupied.shape, plan.cell)]
    corners += [(o.pose.x, o.pose.y) for o in world.obstacles] + [r.pose[:2] for r in world.robots]
    (left, bottom), (right, top) = np.min(corners, axis=0), np.max(corners, axis=0)
    found: list[Pose2] = []
    for draw in range(1000 * count):
        x = left + (right - left) * uniform(seed, draw, 0, 1)
        y = bottom + (top - bottom) * uniform(seed, draw, 0, 2)
        if _is_free(world, x, y) and all(math.hypot(p.x - x, p.y - y) > 2 * _CLEARANCE for p in found):
            found.append(Pose2(float(x), float(y), math.tau * uniform(seed, draw, 0, 3)))
            if len(found) == count:
                return found
    raise UsageError(f"world {world.name} has no room for {count} robots: found only {len(found)} free poses")


def _corners(pose: Pose2, shape: tuple[int, ...], cell: tuple[float, float]) -> list[tuple[float, float]]:
    cos, sin = math.cos(pose.yaw), math.sin(pose.yaw)
    ends = [(u * shape[1] * cell[0], v * shape[0] * cell[1]) for u in (0, 1) for v in (0, 1)]
    return [(pose.x + cos * u - sin * v, pose.y + sin * u + cos * v) for u, v in ends]


def _is_free(world: World, x: float, y: float) -> bool:
    around = [(0.0, 0.0)] + [(math.cos(a), math.sin(a)) for a in np.arange(0.0, math.tau, 0.5)]
    return not any(
        is_occupied(plan, x + r * _CLEARANCE * c, y + r * _CLEARANCE * s)
        for plan in world.floorplans
        for c, s in around
        for r in (0.5, 1.0)
    )
