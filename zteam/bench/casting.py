"""The laser kernel alone, compared in one run with a plain scalar grid traversal from the same compiler."""

import math
from collections.abc import Callable
from statistics import median

import msgspec
import numpy as np

from zteam.bench.simulation import free_poses
from zteam.clock import process_time
from zteam.errors import UsageError
from zteam.kernels.binding import Beams, Bitmaps, Fans, Rays, cast_squares
from zteam.sim.fields import bitmap_of, build_fields
from zteam.world import World

_SCANS = 100
_ROUNDS = 15


class KernelFigures(msgspec.Struct):
    """Rays per second of one core against the world's first bitmap, up to 30 m, from 100 free poses."""

    beams: int
    rays_per_s: float
    scalar_dda_rays_per_s: float
    ratio: float
    """Median ratio of the two kernels, which alternate in each round."""
    max_difference_m: float


def measure_kernels(world: World, beams: int, fov_deg: float, seed: int = 1) -> KernelFigures:
    """Measure both kernels on the same rays. Raises UsageError for a world without a bitmap."""
    if not world.floorplans:
        raise UsageError(f"world {world.name} has no bitmap to cast rays against: use another world, such as office")
    plan = world.floorplans[0]
    maps = Bitmaps([bitmap_of(plan, build_fields(plan.occupied))])
    at = np.array(free_poses(world, _SCANS, seed)).T.copy()
    rays = Rays(at, np.full(_SCANS, plan.z_min), np.full(_SCANS, -1, np.int64))
    angles = np.radians(np.linspace(-fov_deg / 2, fov_deg / 2, beams))[None, :]
    directions = Beams(np.cos(angles), np.sin(angles), math.radians(-fov_deg / 2), 0.0, 30.0)
    leaping, plain = Fans(rays, directions), Fans(rays, directions)

    def cast(fans: Fans) -> None:
        fans.ranges.fill(directions.limit)
        cast_squares(maps, 0, fans, 1, plainly=fans is plain)

    spent = _time_alternately(lambda: cast(leaping), lambda: cast(plain))
    count = plain.ranges.size
    return KernelFigures(
        beams=beams,
        rays_per_s=count / median(s for s, _ in spent),
        scalar_dda_rays_per_s=count / median(p for _, p in spent),
        ratio=median(p / s for s, p in spent),
        max_difference_m=float(np.abs(leaping.ranges - plain.ranges).max()),
    )


def _time_alternately(first: Callable[[], None], second: Callable[[], None]) -> list[tuple[float, float]]:
    """CPU seconds of both calls in each round; a round before the measured ones does not count."""
    spent = []
    for _ in range(_ROUNDS + 1):
        begin = process_time()
        first()
        middle = process_time()
        second()
        spent.append((middle - begin, process_time() - middle))
    return spent[1:]
