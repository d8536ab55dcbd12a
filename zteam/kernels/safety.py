"""The kernels of robots (safety.c, escape.c): what a base meets, and how it gets free. As `binding.py` says."""

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from zteam.kernels.binding import Floats, check_within, empty, ffi, lib, memory


def meet(
    points: Floats, planes: Floats, velocity: tuple[float, float, float], seconds: float, margin: float,
    disc: tuple[float, float, float],
) -> float:  # fmt: skip
    """Seconds until a base first comes nearer to a point than `margin` (m), inf if it does not within `seconds`.

    Where it is nearer than that now, what counts is when it comes nearer still: so it may always move away. `velocity`
    is constant (m/s forwards and to the left, rad/s), its outline the half-planes `planes` (m, 3): outward
    normal of length 1, offset (m). Of `points` (2, n) those in the `disc` (x, y, radius) count, all in the base frame.
    """
    count, sides = points.shape[-1], len(planes)
    given = memory("points", points, 2, count), count, memory("planes", planes, sides, 3), sides
    return float(lib.meet(*given, *velocity, seconds, margin, *disc))


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
    return float(lib.look_along(*_scan(axes, distances), half_width, heading, -math.inf))


def first_clear(axes: Floats, distances: Floats, half_width: float, reach: float, headings: Floats) -> int:
    """Which of `headings` (n, rad) is the first whose corridor, as of `look_along`, is clear for `reach` (m), or -1."""
    count = len(headings)
    given = *_scan(axes, distances), half_width, reach, memory("headings", headings, count), count
    return int(lib.first_clear(*given))


def _scan(axes: Floats, distances: Floats) -> tuple[Any, Any, int]:
    beams = distances.size
    return memory("axes", axes, 2, beams), memory("distances", distances, beams), beams


def find_moves(
    planes: Floats, radius: float, points: ArrayLike, hits: int, way: ArrayLike, shunned: ArrayLike, failed: ArrayLike,
    headings: Floats, cell: float, leaves: tuple[float, float, float],
) -> Floats:  # fmt: skip
    """The moves (n, 4) of a base out of a narrow place: the kind of each, and x, y and yaw of where it ends.

    They lead along `way`. If it has no points, they lead away: `leaves` are the metres from the base if there is room,
    at least, and from places `shunned`. Of `points` the first `hits` are on what stands around, the others on
    teammates. kernels.h has the shapes. Raises ValueError, and MemoryError if `radius` (m) is more than 10 000 cells.
    """
    places = cell * np.arange(-42, 43)
    given = [memory("headings", headings, 16, 5), memory("away", np.hypot(places, places[:, None]), 85, 85)]
    check_within("headings", headings[:, :2], -2, 3)
    for rows, width in ((planes, 3), (points, 2), (way, 2), (shunned, 2), (failed, 4)):
        array = np.array(rows, float, order="C").reshape(-1, width)
        given += memory("rows", array, *array.shape), len(array)
    moves, made = empty(np.float64, 200, 4)
    count = lib.find_moves(ffi.new("surroundings *", (*given, hits, radius, cell, *leaves)), made)
    if count < 0:
        raise MemoryError(f"no room for a search with cells of {cell} m and a base of {radius} m")
    return moves[len(moves) - count :]
