"""The kernels of robots (safety.c, escape.c): what a base meets, and how it gets free. As `binding.py` says."""

import math
from typing import Any

import numpy as np

from zteam.kernels.binding import Cells, Floats, check_within, empty, ffi, lib, memory


def meet(
    points: Floats, planes: Floats, velocity: tuple[float, float, float], seconds: float, margin: float,
    disc: tuple[float, float, float],
) -> float:  # fmt: skip
    """Seconds until a base first comes nearer to a point than `margin` (m), inf if it does not within `seconds`.

    Where it is nearer than that now, what counts is when it comes nearer still: so it may always move away. `velocity`
    is constant (m/s forwards and to the left, rad/s), its outline the half-planes `planes` (m, 3): outward
    normal of length 1, offset (m). Of `points` (2, n) those in the `disc` (x, y, radius) count, all in the base frame.
    """
    count, sides, (x, y, turn) = points.shape[-1], len(planes), velocity
    given = memory("points", points, 2, count), count, memory("planes", planes, sides, 3), sides
    met: float = lib.meet(*given, x, y, turn, seconds, margin, *disc)
    return met


def move_points(points: Floats, x: float, y: float, turn: float) -> None:
    """Tell `points` (3, n: x and y in metres and something else) in a frame that is at this pose (m, rad) of theirs."""
    count = points.shape[-1]
    lib.move_points(memory("points", points, 3, count, out=True), count, x, y, turn)


def see(
    known: Floats, axes: Floats, distances: Floats, laser: tuple[float, float], few: int,
    pose: tuple[float, float, float], far: float, way: float, oldest: float,
) -> Floats:  # fmt: skip
    """What is known after a scan: `known` without what the scan tells of anew, and its hits.

    `known` (3, n) and what is returned: x and y in the base frame (m), and how far the base had travelled when that was
    seen (m): `way` now, and less than `oldest` is forgotten. So is what is more than `far` (m) from the laser, which
    has a `pose` (m, m, rad) in the base frame. The scan: directions `axes` (2, m: cosines and sines) and `distances`
    (m; NaN: it says nothing) of beams, whose first angle and increment are `laser` (rad). Of every `few` beams the
    nearest hit counts. A beam tells of points up to its end, and a little beyond.
    """
    count, beams = known.shape[-1], distances.size
    if few < 1:
        raise ValueError(f"few: {few} is less than 1")
    seen, made = empty(np.float64, 3 * (count - -beams // few))
    given = memory("known", known, 3, count), count, *_scan(axes, distances)
    kept = lib.see(*given, *laser, few, *pose, far, way, oldest, made)
    return seen[: 3 * kept].reshape(3, kept)


def look_along(axes: Floats, distances: Floats, half_width: float, heading: float) -> float:
    """Metres to the nearest hit in a corridor of 2 * `half_width` (m) from the laser towards `heading` (rad), else inf.

    `axes` and `distances` are as for `see`.
    """
    nearest: float = lib.look_along(*_scan(axes, distances), half_width, heading, -math.inf)
    return nearest


def first_clear(axes: Floats, distances: Floats, half_width: float, reach: float, headings: Floats) -> int:
    """Which of `headings` (n, rad) is the first whose corridor, as of `look_along`, is clear for `reach` (m), or -1."""
    count = len(headings)
    given = *_scan(axes, distances), half_width, reach, memory("headings", headings, count), count
    found: int = lib.first_clear(*given)
    return found


def _scan(axes: Floats, distances: Floats) -> tuple[Any, Any, int]:
    beams = distances.size
    return memory("axes", axes, 2, beams), memory("distances", distances, beams), beams


def find_moves(
    hits: Floats, mates: Floats, planes: Floats, headings: Floats, way: Floats, shunned: Floats, failed: Floats,
    away: Floats, cell: float, radius: float, leaves: tuple[float, float, float],
) -> Cells:  # fmt: skip
    """The moves (n, 4) out of a narrow place, the last one first: kind, and column, row and heading of where it ends.

    They lead along `way`; if that has no points, `leaves` metres away if there is room, at least, and from `shunned`.
    `away` (n, n) has the distances (m) of cells of `cell` metres from the one in the middle, where the base is, whose
    outline lies within `radius` (m). No drive begins on the 10 cells at an edge. kernels.h has the shapes of the other
    arrays. Raises ValueError, and MemoryError.
    """
    size = len(away)
    if not (20 < size < 1000 and size % 2 and 0 < len(headings) < 100 and 0.0 < radius <= 1e4 * cell < math.inf):
        raise ValueError(f"away, headings, radius, cell: {size} rows, {len(headings)}, {radius} m, {cell} m")
    check_within("headings", headings[:, :2], -2, 3)
    given = [memory("away", away, size, size), size, radius, cell, *leaves]
    for array, width in ((hits, 2), (mates, 2), (planes, 3), (headings, 4), (way, 3), (shunned, 2), (failed, 4)):
        given += memory("points", array, len(array), width), len(array)
    moves, made = empty(np.int64, 200, 4)
    count = lib.find_moves(ffi.new("surroundings *", given), made)
    if count < 0:
        raise MemoryError("no room for a search")
    return moves[:count]
