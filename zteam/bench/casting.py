"""The laser kernel alone, compared in one run with a plain scalar grid traversal from the same compiler."""

import math
from collections.abc import Callable
from statistics import median

import msgspec
import numpy as np
from numpy.typing import NDArray

from zteam.bench.simulation import free_poses
from zteam.clock import process_time
from zteam.errors import UsageError
from zteam.sim.casting import cast_squares
from zteam.sim.fields import build_fields
from zteam.sim.jit import compiled
from zteam.world import World

Floats = NDArray[np.float64]

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


@compiled
def _cast_scalar(
    occupied: NDArray[np.bool_], cell_x: float, cell_y: float, x: Floats, y: Floats, yaw: Floats, cos: Floats,
    sin: Floats, limit: float, ranges: Floats,
) -> None:  # fmt: skip
    """Traverse the grid cell by cell along every ray (Amanatides and Woo 1987)."""
    rows, columns = occupied.shape
    for scan in range(x.shape[0]):
        px, py = x[scan] / cell_x, y[scan] / cell_y
        c0, s0 = math.cos(yaw[scan]), math.sin(yaw[scan])
        for beam in range(cos.shape[0]):
            dx = (c0 * cos[beam] - s0 * sin[beam]) / cell_x
            dy = (s0 * cos[beam] + c0 * sin[beam]) / cell_y
            ix, iy = math.floor(px), math.floor(py)
            step_x, step_y = 1 if dx >= 0.0 else -1, 1 if dy >= 0.0 else -1
            across_x, across_y = 1.0 / max(abs(dx), 1e-9), 1.0 / max(abs(dy), 1e-9)
            next_x = (ix + 1 - px if dx >= 0.0 else px - ix) * across_x
            next_y = (iy + 1 - py if dy >= 0.0 else py - iy) * across_y
            t = 0.0
            while True:
                if ix < 0 or iy < 0 or ix >= columns or iy >= rows or t >= limit:
                    t = limit
                    break
                if occupied[iy, ix]:
                    break
                if next_x <= next_y:
                    t, next_x, ix = next_x, next_x + across_x, ix + step_x
                else:
                    t, next_y, iy = next_y, next_y + across_y, iy + step_y
            ranges[scan, beam] = t


def measure_kernels(world: World, beams: int, fov_deg: float, seed: int = 1) -> KernelFigures:
    """Measure both kernels on the same rays. Raises UsageError for a world without a bitmap."""
    if not world.floorplans:
        raise UsageError(f"world {world.name} has no bitmap to cast rays against: use another world, such as office")
    plan = world.floorplans[0]
    cos_p, sin_p = math.cos(plan.pose.yaw), math.sin(plan.pose.yaw)
    poses = np.array(free_poses(world, _SCANS, seed))
    dx, dy = poses[:, 0] - plan.pose.x, poses[:, 1] - plan.pose.y
    x, y, yaw = cos_p * dx + sin_p * dy, cos_p * dy - sin_p * dx, poses[:, 2] - plan.pose.yaw
    angles = np.radians(np.linspace(-fov_deg / 2, fov_deg / 2, beams))
    cos, sin, limit = np.cos(angles), np.sin(angles), 30.0
    fields, seen = build_fields(plan.occupied), np.ones(len(x), bool)
    ranges, plain = np.empty((2, len(x), beams))
    hit = np.empty(ranges.shape, np.int32)

    def squares() -> None:
        ranges[:] = limit
        cast_squares(
            fields.sides, fields.rows, fields.columns, *plan.cell, x, y, yaw, seen, cos[None, :], sin[None, :], limit,
            1, ranges, hit,
        )  # fmt: skip

    def scalar() -> None:
        _cast_scalar(plan.occupied, *plan.cell, x, y, yaw, cos, sin, limit, plain)

    spent = _time_alternately(squares, scalar)
    rays = ranges.size
    return KernelFigures(
        beams=beams,
        rays_per_s=rays / median(s for s, _ in spent),
        scalar_dda_rays_per_s=rays / median(p for _, p in spent),
        ratio=median(p / s for s, p in spent),
        max_difference_m=float(np.abs(ranges - plain).max()),
    )


def _time_alternately(first: Callable[[], None], second: Callable[[], None]) -> list[tuple[float, float]]:
    """CPU seconds of both calls in each round; a round before the measured ones compiles them."""
    spent = []
    for _ in range(_ROUNDS + 1):
        begin = process_time()
        first()
        middle = process_time()
        second()
        spent.append((middle - begin, process_time() - middle))
    return spent[1:]
