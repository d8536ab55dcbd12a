"""The kernels of formations (formations.c): the slots of robots, and the walls beside them. See `binding.py`."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from zteam.kernels.binding import Floats, empty, ffi, lib, memory

Point = tuple[float, float]


def assign(costs: Floats) -> list[int]:
    """The column of each row in the cheapest assignment of (n, n) costs. What is no number costs 1e300."""
    count = len(costs)
    given = memory("costs", costs, count, count)
    found, made = empty(np.int64, 3 * (count + 1))
    lib.assign(given, count, empty(np.float64, 3 * (count + 1))[1], made)
    columns: list[int] = found[count + 1 : 2 * count + 1].tolist()
    return columns


def _walls(axes: Floats, distances: Floats, mates: Sequence[Point], body: float) -> tuple[Any, Any]:
    """What C takes, and what has to outlive it."""
    rows, beams = np.array(mates, float).reshape(len(mates), 2), distances.size
    kept = memory("axes", axes, 2, beams), memory("distances", distances, beams), memory("mates", rows, *rows.shape)
    return ffi.new("walls *", (*kept[:2], beams, kept[2], len(rows), body)), (kept, rows)


def find_sides(
    axes: Floats, distances: Floats, mates: Sequence[Point], body: float, bound: float,
    places: Sequence[tuple[float, float, float, float]], limits: tuple[float, float, float],
) -> tuple[float, float]:  # fmt: skip
    """Metres to the nearest wall to the left and to the right of places of a trail (x, y, cosine and sine), else inf.

    The scan: directions `axes` (2, n: cosines and sines) and `distances` (m) of beams, those less than `bound` and not
    within `body` (m) of `mates`. A wall counts that is so far behind to so far ahead of a place, and so far beside it:
    `limits` (m).
    """
    walls, _kept = _walls(axes, distances, mates, body)
    rows, (least, made) = np.array(places, float).reshape(len(places), 4), empty(np.float64, 2)
    lib.find_sides(walls, bound, memory("places", rows, *rows.shape), len(rows), *limits, made)
    left, right = least.tolist()
    return left, right


def is_between(
    axes: Floats, distances: Floats, mates: Sequence[Point], body: float, angles: Floats,
    limits: tuple[float, float, float, float],
) -> bool:  # fmt: skip
    """Whether walls are on both sides: as kernels.h says of `limits` (m, and three in rad). `angles` (n) are those of
    the beams; for the others see `find_sides`."""
    walls, _kept = _walls(axes, distances, mates, body)
    return bool(lib.is_between(walls, memory("angles", angles, distances.size), *limits))
