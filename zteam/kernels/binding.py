"""The kernels as Python calls them. Each checks what it is given; what is wrong raises ValueError.

Arrays are numpy's, in C order. A kernel that is called in every tick takes its arrays once, as an object that is made
for it and keeps them: their contents may change, the arrays not.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

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


class Bitmap(NamedTuple):
    """A bitmap that rays and bodies meet."""

    sides: NDArray[np.uint8]
    """(4, rows * columns + 1): of the largest empty square at each cell, by quadrant (`zteam.sim.fields`)."""
    rows: int
    columns: int
    cell_x: float
    """Metres."""
    cell_y: float
    x: float
    """Of its lower left corner in `map`, metres."""
    y: float
    yaw: float
    z_min: float
    """Metres: what lies between these heights meets it."""
    z_max: float


class Bitmaps:
    """Bitmaps for kernels."""

    def __init__(self, maps: Sequence[Bitmap]) -> None:
        self.count = len(maps)
        self.data = ffi.new("bitmap[]", self.count)
        self._kept = []
        for made, one in zip(self.data, maps, strict=True):
            sides, *numbers = one
            if one.rows < 0 or one.columns < 0 or 4 * (one.rows * one.columns + 1) >= 1 << 31:
                raise ValueError(f"sides: {one.rows} x {one.columns} cells are none, or too many for 32 bits")
            self._kept.append(_given("sides", sides, _UINT8, 4, one.rows * one.columns + 1))
            if sides[:, -1].any():
                raise ValueError("sides: the last entry of each quadrant, where rays are parked, is not 0")
            made.sides = self._kept[-1]
            _, *names = Bitmap._fields
            for name, number in zip(names, numbers, strict=True):
                setattr(made, name, number)


class Beams(NamedTuple):
    """Directions of the beams of fans in the sensor's frame."""

    cos: Floats
    """(tables, beams): one row for all fans, or one for each."""
    sin: Floats
    angle_min: float
    increment: float
    limit: float
    """Nothing at this distance (metres) or beyond is seen."""
    jitter: float = 0.0
    """Increments that a beam may be off its place."""


class Rays(NamedTuple):
    """Where fans of rays start, in `map`: arrays (fans), metres and radians."""

    x: Floats
    y: Floats
    z: Floats
    yaw: Floats
    owner: NDArray[np.int64]
    """The mover that carries the sensor and that the sensor does not see, or -1."""


class Fans:
    """Fans of rays, and what they met. The arrays are kept: their contents may change."""

    def __init__(self, rays: Rays, beams: Beams) -> None:
        count, width = len(rays.x), beams.cos.shape[1]
        tables = 1 if len(beams.cos) == 1 else count
        self.beams = beams
        self.ranges, self.hits = np.empty((count, width)), np.empty((count, width), np.int32)
        """(fans, beams): metres, and what was met."""
        self._kept = {
            "x": _given("x", rays.x, _DOUBLE, count),
            "y": _given("y", rays.y, _DOUBLE, count),
            "z": _given("z", rays.z, _DOUBLE, count),
            "yaw": _given("yaw", rays.yaw, _DOUBLE, count),
            "owner": _given("owner", rays.owner, _INT64, count),
            "cosine": _given("cos", beams.cos, _DOUBLE, tables, width),
            "sine": _given("sin", beams.sin, _DOUBLE, tables, width),
            "ranges": _given("ranges", self.ranges, _DOUBLE, count, width, out=True),
            "hits": _given("hits", self.hits, _INT32, count, width, out=True),
            "tops": _given("tops", np.empty(width // 8 + 1), _DOUBLE, width // 8 + 1, out=True),
        }
        numbers = {name: getattr(beams, name) for name in ("angle_min", "increment", "limit", "jitter")}
        self.data = ffi.new("fans *", {"count": count, "beams": width, "tables": tables, **numbers, **self._kept})


class Polygons:
    """Polygons in groups that move together: the shapes of a mover, or a shape that stands still. Kernels move them."""

    def __init__(
        self, x: Floats, y: Floats, first_vertex: NDArray[np.int32], z_min: Floats, z_max: Floats,
        first_shape: NDArray[np.int32], owner: NDArray[np.int64], centre: Floats, radius: Floats,
    ) -> None:  # fmt: skip
        """Vertices x, y, counter-clockwise, in the mover's frame; in `map` for what stands still.

        Shape i has the vertices first_vertex[i] to first_vertex[i + 1] and the heights z_min[i] to z_max[i]; group i
        the shapes first_shape[i] to first_shape[i + 1], the mover owner[i] (or -1), and a circle about centre[i] (x, y)
        of radius[i] that holds them all.
        """
        shapes, groups = len(z_min), len(owner)
        self.owner = owner
        self.movers = int(owner.max(initial=-1)) + 1
        _within("owner", owner, -1, self.movers)
        for name, starts, count in (("first_vertex", first_vertex, len(x)), ("first_shape", first_shape, shapes)):
            if not (starts.size and starts[0] == 0 and starts[-1] == count and (np.diff(starts) > 0).all()):
                raise ValueError(f"{name}: it does not rise from 0 to {count}, at each step")
        room = int(np.diff(first_vertex).max(initial=0))
        self._kept = {
            "local_x": _given("x", x, _DOUBLE, len(x)),
            "local_y": _given("y", y, _DOUBLE, len(x)),
            "x": _given("x", x.copy(), _DOUBLE, len(x), out=True),
            "y": _given("y", y.copy(), _DOUBLE, len(x), out=True),
            "first_vertex": _given("first_vertex", first_vertex, _INT32, shapes + 1),
            "z_min": _given("z_min", z_min, _DOUBLE, shapes),
            "z_max": _given("z_max", z_max, _DOUBLE, shapes),
            "first_shape": _given("first_shape", first_shape, _INT32, groups + 1),
            "owner": _given("owner", owner, _INT64, groups),
            "local_centre": _given("centre", centre, _DOUBLE, groups, 2),
            "centre_x": _given("centre", centre[:, 0].copy(), _DOUBLE, groups, out=True),
            "centre_y": _given("centre", centre[:, 1].copy(), _DOUBLE, groups, out=True),
            "radius": _given("radius", radius, _DOUBLE, groups),
            "in_bin": _given("in_bin", np.empty(groups, np.int32), _INT32, groups, out=True),
            "bin_start": _given("bin_start", np.empty(64 * 64 + 2, np.int32), _INT32, 64 * 64 + 2, out=True),
            "corner_x": _given("corner_x", np.empty(room), _DOUBLE, room, out=True),
            "corner_y": _given("corner_y", np.empty(room), _DOUBLE, room, out=True),
        }
        counts = {"shapes": shapes, "groups": groups, "movers": self.movers}
        self.data = ffi.new("polygons *", {**counts, **self._kept})
        self.move(np.zeros((self.movers, 3)))

    def move(self, poses: Floats) -> None:
        """Bring the groups of movers to `poses` (movers or more; x, y, yaw in `map`)."""
        lib.move_polygons(self.data, self.poses(poses))

    def poses(self, poses: Floats, *, name: str = "poses", out: bool = False) -> Any:
        """The memory of an array of poses (movers or more; x, y, yaw)."""
        if len(poses) < self.movers:
            raise ValueError(f"{name}: {len(poses)} are too few for {self.movers} movers")
        return _given(name, poses, _DOUBLE, len(poses), 3, out=out)


_cast_squares = lib.cast_squares_avx2 if lib.has_avx2() else lib.cast_squares


def fill_squares(free: NDArray[np.bool_], out: NDArray[np.uint8]) -> None:
    """The side of the largest square of `free` cells (rows, columns) that begins at each and extends towards larger
    rows and columns, at most 254, into `out` (rows * columns)."""
    rows, columns = free.shape
    lib.fill_squares(
        _given("free", free, _BOOL, rows, columns), rows, columns, _given("out", out, _UINT8, rows * columns, out=True)
    )


def cast_squares(maps: Bitmaps, index: int, fans: Fans, mark: int, *, plainly: bool = False) -> None:
    """Shorten ranges to the occupied cells of a bitmap, and set hits to `mark` where it is nearer.

    A start inside an occupied cell gives 0. A sensor sees only a bitmap that has its height. `plainly`: cell by cell,
    for starts inside the bitmap and one row of beams; it is there to be compared with.
    """
    if not 0 <= index < maps.count:
        raise ValueError(f"index: {index} is not within 0 to {maps.count - 1}")
    (lib.cast_cells if plainly else _cast_squares)(maps.data + index, fans.data, mark)


def cast_edges(polygons: Polygons, fans: Fans) -> None:
    """Shorten ranges to polygons, to 0 in their interior, and set hits to the index of the shape where one is nearer."""
    lib.cast_edges(polygons.data, fans.data)


def find_overlaps(polygons: Polygons, maps: Bitmaps, apart: bool, found: NDArray[np.bool_]) -> None:
    """Which movers (`found`) overlap a bitmap or what stands still where they are; with `apart` each other too."""
    if len(found) < polygons.movers:
        raise ValueError(f"found: {len(found)} are too few for {polygons.movers} movers")
    lib.find_overlaps(polygons.data, maps.data, maps.count, apart, _given("found", found, _BOOL, len(found), out=True))


def move_all(polygons: Polygons, maps: Bitmaps, poses: Floats, ends: Floats, blocked: NDArray[np.bool_]) -> None:
    """Move robots, in order, from `poses` (movers; x, y, yaw) to `ends` (robots; x, y, yaw): a move that meets
    something is `blocked` (robots), and not made at all. The polygons are at `poses`."""
    robots = len(ends)
    if robots > len(poses):
        raise ValueError(f"ends: {robots} are too many for {len(poses)} poses")
    lib.move_all(
        polygons.data, maps.data, maps.count, robots, polygons.poses(poses, out=True),
        _given("ends", ends, _DOUBLE, robots, 3), _given("blocked", blocked, _BOOL, robots, out=True),
    )  # fmt: skip


def hold(
    polygons: Polygons, maps: Bitmaps, half: Floats, poses: Floats, ends: Floats, suspects: NDArray[np.bool_],
    tangled: NDArray[np.bool_], apart: bool,
) -> Floats:  # fmt: skip
    """Cut the ways of the `suspects` (movers) from `poses` to `ends` (movers; x, y, yaw) to what is free; the shares
    (movers) that are left.

    `half` (groups) is half the width of a body in metres: no two places that are tested are farther apart. With `apart`
    bodies stay out of each other too, unless both are `tangled` (movers). The polygons are at `poses`.
    """
    movers, groups = len(poses), len(polygons.owner)
    places, shares = np.zeros(movers), np.ones(movers)
    lib.hold(
        polygons.data, maps.data, maps.count, _given("half", half, _DOUBLE, groups), polygons.poses(poses),
        _given("ends", ends, _DOUBLE, movers, 3, out=True), _given("suspects", suspects, _BOOL, movers),
        _given("tangled", tangled, _BOOL, movers), apart, _given("places", places, _DOUBLE, movers, out=True),
        _given("shares", shares, _DOUBLE, movers, out=True),
    )  # fmt: skip
    return shares


def follow(poses: Floats, velocity: Floats, seconds: float, *, tangents: bool = False) -> Floats:
    """Where robots at `poses` (robots; x, y, yaw) get to at constant body velocity (robots; m/s, m/s, rad/s).

    On the exact arc or, with `tangents`, as Stage steps (Euler): straight ahead by the old heading, then the turn.
    """
    ends, count = np.empty_like(poses), len(poses)
    lib.follow(
        count, _given("poses", poses, _DOUBLE, count, 3), _given("velocity", velocity, _DOUBLE, count, 3), seconds,
        tangents, _given("ends", ends, _DOUBLE, count, 3, out=True),
    )  # fmt: skip
    return ends


def measure(before: Floats, after: Floats, seconds: float, *, tangents: bool = False) -> Floats:
    """The body velocity (robots; m/s, m/s, rad/s) of the arcs that lead from `before` to `after` (robots; x, y, yaw).

    With `tangents` of Stage's steps, by the heading before.
    """
    velocity, count = np.empty_like(before), len(before)
    lib.measure(
        count, _given("before", before, _DOUBLE, count, 3), _given("after", after, _DOUBLE, count, 3), seconds,
        tangents, _given("velocity", velocity, _DOUBLE, count, 3, out=True),
    )  # fmt: skip
    return velocity


# costmaps.c: grids of costs

# search.c: ways over grids of weights

# particles.c: localisation

# safety.c: what a base meets
