"""The kernels as Python calls them. Each checks what it is given; what is wrong raises ValueError.

Arrays are numpy's, in C order. A kernel that is called in every tick takes its arrays once, as an object that is made
for it and keeps them: their contents may change, the arrays not.
"""

import math
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from zteam.kernels.declarations import ffi

lib: Any = ffi.dlopen(str(Path(__file__).with_name("library.so")))

_POINTERS = {
    np.dtype(kind): ffi.typeof(f"{name}[]")
    for kind, name in (
        (np.bool_, "uint8_t"),
        (np.uint8, "uint8_t"),
        (np.uint16, "uint16_t"),
        (np.uint32, "uint32_t"),
        (np.int32, "int32_t"),
        (np.int64, "int64_t"),
        (np.float64, "double"),
    )
}
_BOOL, _UINT8, _UINT16, _UINT32, _INT32, _INT64, _DOUBLE = _POINTERS
Floats = NDArray[np.float64]


def _given(name: str, array: NDArray[Any], kind: np.dtype[Any], *shape: int, out: bool = False) -> Any:
    """An array's memory, for C to read, or to write to (`out`). Raises ValueError unless it has this type and shape."""
    if array.dtype != kind or array.shape != shape:
        raise ValueError(f"{name}: {array.dtype} {array.shape} is not {kind} {shape}")
    try:
        return ffi.from_buffer(_POINTERS[kind], array, out)
    except (BufferError, ValueError) as error:
        raise ValueError(f"{name}: {error}") from None


def _within(name: str, array: NDArray[Any], low: int, high: int) -> None:
    """Raise ValueError unless all these numbers lie from `low` to below `high`: they are indexes."""
    if array.size and not (low <= array.min() and array.max() < high):
        raise ValueError(f"{name}: {array.min()} to {array.max()} is not within {low} to {high - 1}")


# squares.c, edges.c, bodies.c: the simulator

# costmaps.c: grids of costs

# search.c: ways over grids of weights

# particles.c: localisation

# safety.c: what a base meets


def meet(
    points: Floats, planes: Floats, motion: tuple[float, float, float], seconds: float, margin: float,
    disc: tuple[float, float, float],
) -> float:  # fmt: skip
    """Seconds until a base first comes nearer to a point than `margin` (m), inf if it does not within `seconds`.

    Where it is nearer than that now, what counts is when it comes nearer still: so it may always move away. `motion` is
    its constant velocity (m/s forwards, rad/s, m/s to the left), its outline the half-planes `planes` (m, 3): outward
    normal of length 1, offset (m). Of `points` (2, n) those in the `disc` (x, y, radius) count, all in the base frame.
    """
    count, sides, (x, turn, y) = points.shape[-1], len(planes), motion
    given = _given("points", points, _DOUBLE, 2, count), count, _given("planes", planes, _DOUBLE, sides, 3), sides
    met: float = lib.meet(*given, x, y, turn, seconds, margin, *disc)
    return met


def move_points(points: Floats, x: float, y: float, turn: float) -> None:
    """Tell `points` (3, n: x and y in metres and something else) in a frame that is at this pose (m, rad) of theirs."""
    count = points.shape[-1]
    lib.move_points(_given("points", points, _DOUBLE, 3, count, out=True), count, x, y, turn)


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
    seen = np.empty(3 * (count - -beams // few))
    given = _given("known", known, _DOUBLE, 3, count), count, *_scan(axes, distances)
    kept = lib.see(*given, *laser, few, *pose, far, way, oldest, ffi.from_buffer("double[]", seen, True))
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
    given = *_scan(axes, distances), half_width, reach, _given("headings", headings, _DOUBLE, count), count
    found: int = lib.first_clear(*given)
    return found


def _scan(axes: Floats, distances: Floats) -> tuple[Any, Any, int]:
    beams = distances.size
    return _given("axes", axes, _DOUBLE, 2, beams), _given("distances", distances, _DOUBLE, beams), beams
