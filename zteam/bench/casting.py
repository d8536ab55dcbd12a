"""The laser kernels alone: rays against a bitmap, and against robots."""

import math
from collections.abc import Callable
from statistics import median

import msgspec
import numpy as np

from zteam.bench.navigation.figures import reference_ms
from zteam.bench.simulation import free_poses
from zteam.clock import process_time
from zteam.errors import UsageError
from zteam.kernels.binding import BeamTable, Bitmaps, Fans, Rays, cast_edges, cast_squares
from zteam.sim.casting import bitmap_of, build_fields, group_shapes, make_polygons
from zteam.world import World, add_robot

_SCANS = 100
_ROUNDS = 15


class KernelFigures(msgspec.Struct):
    """Rays per second of one core, up to 30 m, from 100 free poses."""

    target: str
    beams: int
    rays_per_s: float
    ratio: float
    """Time of a fixed piece of numpy (`reference_ms`) by that of these 100 scans: the median of alternating rounds."""


def measure_kernels(world: World, seed: int = 1) -> list[KernelFigures]:
    """Measure rays against the world's first bitmap, and against 100 robots. Raises UsageError without a bitmap."""
    if not world.floorplans:
        raise UsageError(f"world {world.name} has no bitmap to cast rays against: use another world, such as office")
    plan = world.floorplans[0]
    maps = Bitmaps([bitmap_of(plan, build_fields(plan.occupied))])
    robots = [add_robot(world, "erratic", pose, f"r{i}") for i, pose in enumerate(free_poses(world, _SCANS, seed + 1))]
    polygons = make_polygons(group_shapes(robots, []))
    polygons.move(np.array([robot.pose for robot in robots], float))
    at = np.array(free_poses(world, _SCANS, seed)).T.copy()
    rays = Rays(at, np.full(_SCANS, plan.z_min + 0.1), np.full(_SCANS, -1, np.int64))
    return [
        _measure("bitmap", rays, 1081, 270.0, lambda fans: cast_squares(maps, 0, fans, 1)),
        _measure("bitmap", rays, 180, 180.0, lambda fans: cast_squares(maps, 0, fans, 1)),
        _measure(f"{len(robots)} robots", rays, 1081, 270.0, lambda fans: cast_edges(polygons, fans)),
    ]


def _measure(target: str, rays: Rays, beams: int, fov_deg: float, cast: Callable[[Fans], None]) -> KernelFigures:
    angles = np.radians(np.linspace(-fov_deg / 2, fov_deg / 2, beams))[None, :]
    first, increment = math.radians(-fov_deg / 2), math.radians(fov_deg) / (beams - 1)
    fans = Fans(rays, BeamTable(np.cos(angles), np.sin(angles), first, increment, 30.0))
    spent, ratios = [], []
    for _ in range(_ROUNDS):
        fans.ranges.fill(30.0)
        begin = process_time()
        cast(fans)
        spent.append(process_time() - begin)
        ratios.append(1e-3 * reference_ms() / spent[-1])
    return KernelFigures(target, beams, fans.ranges.size / median(spent), median(ratios))
