"""The kernels as Python calls them. Each checks what it is given; what is wrong raises ValueError.

Arrays are numpy's, in C order. A kernel that is called in every tick takes its arrays once, as an object that is made
for it and keeps them: their contents may change, the arrays not.
"""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

try:
    from zteam.kernels import declarations
except ImportError:
    raise ImportError("zteam's kernels are not compiled here: run pip install -e . in the checkout") from None

ffi: Any = declarations.ffi
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
        (np.float32, "float"),
        (np.float64, "double"),
    )
}
_BOOL, _UINT8, _UINT16, _UINT32, _INT32, _INT64, _FLOAT, _DOUBLE = _POINTERS
Floats = NDArray[np.float64]
Bytes = NDArray[np.uint8]
Cells = NDArray[np.int64]
Counts = NDArray[np.uint32]


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
    """(4, rows * columns + 1): of the largest empty square at each cell, by quadrant (`simulator.core.casting`)."""
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


class BeamTable(NamedTuple):
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

    @staticmethod
    def ahead(limit: float) -> "BeamTable":
        """A single beam straight ahead."""
        return BeamTable(np.ones((1, 1)), np.zeros((1, 1)), 0.0, 0.0, limit)


class Rays(NamedTuple):
    """Where fans of rays start: sensors in `map`, or in the base frames of their robots."""

    at: Floats
    """(3, fans): rows x, y (metres) and yaw (radians)."""
    z: Floats
    """(fans): metres above the ground."""
    owner: NDArray[np.int64]
    """(fans): the mover that carries the sensor and that the sensor does not see, or -1."""


class Fans:
    """Fans of rays, and what they met. The arrays are kept: their contents may change."""

    def __init__(self, rays: Rays, beams: BeamTable) -> None:
        count, width = len(rays.z), beams.cos.shape[1]
        tables = 1 if len(beams.cos) == 1 else count
        self.beams = beams
        self.ranges, self.hits = np.empty((count, width)), np.empty((count, width), np.int32)
        """(fans, beams): metres, and what was met."""
        self._kept = {
            "at": _given("at", rays.at, _DOUBLE, 3, count),
            "z": _given("z", rays.z, _DOUBLE, count),
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

    def poses(self, poses: Floats, *, out: bool = False) -> Any:
        """The memory of an array of poses (movers or more; x, y, yaw)."""
        if len(poses) < self.movers:
            raise ValueError(f"poses: {len(poses)} are too few for {self.movers} movers")
        return _given("poses", poses, _DOUBLE, len(poses), 3, out=out)


_cast_squares = lib.cast_squares_avx2 if lib.has_avx2() else lib.cast_squares


def fill_squares(free: NDArray[np.bool_], out: NDArray[np.uint8]) -> None:
    """The side of the largest square of `free` cells (rows, columns) that begins at each and extends towards larger
    rows and columns, at most 254, into `out` (rows * columns)."""
    rows, columns = free.shape
    lib.fill_squares(
        _given("free", free, _BOOL, rows, columns), rows, columns, _given("out", out, _UINT8, rows * columns, out=True)
    )


def cast_squares(maps: Bitmaps, index: int, fans: Fans, mark: int) -> None:
    """Shorten ranges to the occupied cells of a bitmap, and set hits to `mark` where it is nearer.

    A start inside an occupied cell gives 0. A sensor sees only a bitmap that has its height.
    """
    if not 0 <= index < maps.count:
        raise ValueError(f"index: {index} is not within 0 to {maps.count - 1}")
    _cast_squares(maps.data + index, fans.data, mark)


def cast_edges(polygons: Polygons, fans: Fans) -> None:
    """Shorten ranges to polygons, to 0 in their interior, and set hits to the index of the shape that is nearer."""
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


def place_mounts(mounts: Rays, poses: Floats, rays: Rays) -> None:
    """Bring the `rays` (in `map`) of sensors, which are mounted so, to where they are now: with the robots at `poses`
    (robots; x, y, yaw)."""
    count, robots = len(mounts.z), len(poses)
    owner, at = _given("owner", mounts.owner, _INT64, count), _given("mounts", mounts.at, _DOUBLE, 3, count)
    poses, out = _given("poses", poses, _DOUBLE, robots, 3), _given("rays", rays.at, _DOUBLE, 3, count, out=True)
    if not lib.place_mounts(count, owner, at, robots, poses, out):
        raise ValueError(f"owner: a robot is not within 0 to {robots - 1}")


class Bases:
    """The bases of all robots, their odometry without errors, and their wheels.

    Rows are x, y (m/s) and yaw (rad/s) in the base frame.
    """

    def __init__(
        self, limits: Floats, is_car: NDArray[np.bool_], wheelbase: Floats, start: Floats,
        wheel_owner: NDArray[np.int64], wheel_rows: Floats,
    ) -> None:  # fmt: skip
        """`limits` (4, robots, 3): least and largest velocity, least (below 0) and largest acceleration.

        Odometry is zero at `start` (robots; x, y, yaw in `map`). A wheel turns by its row of `wheel_rows` (wheels, 3;
        rad/s for each unit of velocity) with its robot, `wheel_owner` (wheels).
        """
        robots, wheels = len(is_car), len(wheel_owner)
        _within("wheel_owner", wheel_owner, 0, robots)
        self.setpoint, self.velocity, self.odom = np.zeros((3, robots, 3))
        """(robots, 3): velocity as commanded, within the limits; velocity as it was; pose seen from the start."""
        self.start, self.is_car = start, is_car
        self.angles, self.rates = np.zeros((2, wheels))
        """(wheels): rad since the start, and rad/s."""
        of_robots = dict(zip(("low", "high", "slow", "fast"), limits, strict=True), start=start)
        of_robots |= {"setpoint": self.setpoint, "velocity": self.velocity, "odom": self.odom}
        self._kept = {
            **{name: _given(name, array, _DOUBLE, robots, 3) for name, array in of_robots.items()},
            "is_car": _given("is_car", is_car, _BOOL, robots),
            "wheelbase": _given("wheelbase", wheelbase, _DOUBLE, robots),
            "wheel_owner": _given("wheel_owner", wheel_owner, _INT64, wheels),
            "wheel_rows": _given("wheel_rows", wheel_rows, _DOUBLE, wheels, 3),
            "angles": _given("angles", self.angles, _DOUBLE, wheels, out=True),
            "rates": _given("rates", self.rates, _DOUBLE, wheels, out=True),
        }
        self._robots = robots
        self._data = ffi.new("bases *", {"robots": robots, "wheels": wheels, **self._kept})

    def obey(self, commands: Floats, fresh: NDArray[np.bool_], seconds: float) -> None:
        """Change the setpoints towards `commands` (robots, 3) as far as the limits allow in `seconds`; one that is not
        `fresh` (robots) is 0.

        A car's angular command is Stage's: the angle of the steered wheels, v sin(angle) / wheelbase the yaw rate.
        """
        count = self._robots
        given = _given("commands", commands, _DOUBLE, count, 3), _given("fresh", fresh, _BOOL, count)
        lib.obey(self._data, *given, seconds)

    def note_motion(self, before: Floats, after: Floats, seconds: float, *, tangents: bool) -> None:
        """Note velocity, odometry and wheels after the ways from `before` to `after` (robots; x, y, yaw in `map`).

        They were arcs or, with `tangents`, Stage's steps by the heading before.
        """
        count = self._robots
        given = _given("before", before, _DOUBLE, count, 3), _given("after", after, _DOUBLE, count, 3)
        lib.note_motion(self._data, *given, seconds, tangents)


# costmaps.c: grids of costs

_MOST_REACH = 180
"""Cells: the sum of two squares of it fits into 16 bits."""
_WIDEST = 10_000
"""Cells from a robot's base to its corners."""
_FARTHEST = 1 << 58
"""Cells from the grid at which a beam may end: twice a beam's length fits into 64 bits."""


def _grid(name: str, array: NDArray[Any], kind: np.dtype[Any], out: bool = False) -> tuple[Any, int, int]:
    """An array's memory, its rows and its columns. Raises ValueError unless it has two dimensions."""
    if array.ndim != 2:
        raise ValueError(f"{name}: {array.ndim} dimensions are not 2")
    return _given(name, array, kind, *array.shape, out=out), array.shape[0], array.shape[1]


Window = tuple[int, int, int, int]
"""Rows from, to (not included), columns from, to."""


def _inflate(costs: Bytes, window: Window, reach: int, table: Any, unknown_from: int, out: Any) -> NDArray[np.uint16]:
    grid, rows, columns = _grid("costs", costs, _UINT8)
    r0, r1, c0, c1 = window
    if not (0 <= r0 <= r1 <= rows and 0 <= c0 <= c1 <= columns and 0 <= reach <= _MOST_REACH):
        raise ValueError(f"window, reach: {window} is not within {rows} rows and {columns} columns, or {reach} too far")
    width = c1 - c0 + 2 * reach
    steps, line = np.empty((r1 - r0 + 2 * reach + 1) * width, np.uint8), np.empty(width, np.uint16)
    squares = np.empty((r1 - r0, c1 - c0), np.uint16)
    scratch = _given("steps", steps, _UINT8, len(steps), out=True), _given("line", line, _UINT16, width, out=True)
    made = _given("squares", squares, _UINT16, *squares.shape, out=True)
    lib.inflate(grid, rows, columns, window, reach, *scratch, made, table, unknown_from, out)
    return squares


def square_distances(costs: Bytes, window: Window, reach: int) -> NDArray[np.uint16]:
    """Squared distance of each cell of a window of `costs` (rows, columns) to the nearest lethal one, in cells.

    Distances are exact, from centre to centre, and cut to (`reach` + 1)². Raises ValueError.
    """
    return _inflate(costs, window, reach, ffi.NULL, 0, ffi.NULL)


def inflate(costs: Bytes, table: Bytes, reach: int, window: Window, unknown_from: int, out: Bytes) -> None:
    """Raise the cells in `window` of `costs` (rows, columns) to the cost of their distance to a lethal one, into `out`.

    `table` ((`reach` + 1)² + 1) has the cost by squared distance in cells; lethal cells up to `reach` cells outside of
    the window count. A cell without information gets a cost from `unknown_from` on. Raises ValueError.
    """
    prices = _given("table", table, _UINT8, (reach + 1) ** 2 + 1)
    _inflate(costs, window, reach, prices, unknown_from, _given("out", out, _UINT8, *costs.shape, out=True))


def trace_beams(costs: Bytes, x0: int, y0: int, ends: Cells, marks: Cells) -> None:
    """Clear the cells from the sensor's (column `x0`, row `y0`) to each of `ends` (n, 2), then mark `marks` (m, 2).

    Cells are (column, row); those outside of `costs` (rows, columns) are left out. Raises ValueError.
    """
    for name, cells in (("x0, y0", np.array((x0, y0))), ("ends", ends)):
        _within(name, cells, -_FARTHEST, _FARTHEST)
    grid = _grid("costs", costs, _UINT8, out=True)
    beams = _given("ends", ends, _INT64, len(ends), 2), len(ends)
    lib.trace_beams(*grid, x0, y0, *beams, _given("marks", marks, _INT64, len(marks), 2), len(marks))


def find_hit(costs: Bytes, corners: Floats, x: float, y: float, yaw: float, motion: Floats, steps: int) -> int:
    """The first step of `steps` at which a robot touches a lethal cell that it does not touch at the start; else -1.

    All is in cells of `costs` (rows, columns): the robot's `corners` (n, 2) in its base frame, its pose in the grid,
    and `motion` (3) of one step, forwards, to the left and radians, on an arc. With 0 steps: 0 if it touches any lethal
    cell where it stands. What is outside of the grid is lethal, also if it is not finite. Raises ValueError.
    """
    count = len(corners)
    if not count or steps < 0 or np.abs(corners).max() > _WIDEST:
        raise ValueError(f"corners, steps: {count} corners up to {_WIDEST} cells from the base, {steps} steps")
    outline = _given("corners", corners, _DOUBLE, count, 2)
    points = np.empty((2, count, 2))
    return int(
        lib.find_hit(
            *_grid("costs", costs, _UINT8), outline, count, x, y, yaw, _given("motion", motion, _DOUBLE, 3), steps,
            _given("points", points, _DOUBLE, 2, count, 2, out=True),
        )
    )  # fmt: skip


# search.c: ways over grids of weights

UNREACHED = 0xFFFFFFFF
"""Cost of a cell that a search has not met."""


class Steps(NamedTuple):
    """What steps cost."""

    straight: int
    """At weight 1."""
    diagonal: int
    least: int
    """The least weight of a cell that can be entered."""


def weigh_cells(costs: Bytes, neutral: int, factor: int, barred: int, unknown: int, out: Bytes) -> None:
    """Write a costmap's cells (rows, columns) as weights to the inner part of `out` (rows + 2, columns + 2).

    A cell weighs `neutral` + cost · `factor` / 256, cut to a whole number below 256; 0 from the cost `barred` on, and
    `unknown` without information. Raises ValueError.
    """
    grid, rows, columns = _grid("costs", costs, _UINT8)
    made = _given("out", out, _UINT8, rows + 2, columns + 2, out=True)
    _within("neutral, factor, barred, unknown", np.array((neutral, factor, barred, unknown)), 0, 257)
    lib.weigh_cells(grid, rows, columns, neutral, factor, barred, unknown, made)


def _walled(weights: Bytes, steps: Steps, *cells: int) -> tuple[Any, int]:
    """A grid's memory and columns. Raises ValueError unless its border is 0, and those cells, which are inner, not."""
    grid, _, columns = _grid("weights", weights, _UINT8)
    border = weights[[0, -1]].any() or weights[:, [0, -1]].any() if weights.size else True
    if border or weights.size >= 1 << 31:
        raise ValueError("weights: the border is not 0, or there are 2^31 cells")
    if not (0 < steps.straight <= steps.diagonal < 1 << 16 and 0 <= steps.least < 256):
        raise ValueError(f"steps: {steps}")
    for cell in cells:
        if not (0 <= cell < weights.size and weights[divmod(cell, columns)]):
            raise ValueError(f"start or goal: cell {cell} cannot be entered")
    return grid, columns


def search(weights: Bytes, start: int, goal: int, steps: Steps, costs: Counts) -> tuple[bool, list[int]]:
    """Find the cheapest way from `start` to `goal` (indexes of cells): A* with buckets of costs for a queue.

    `weights` (rows, columns) say what a step into a cell costs as a multiple of the step's cost, 0 if it cannot be
    entered, as on the border. The ways' costs are written to `costs` (rows, columns), which are UNREACHED before. A
    diagonal step needs both cells beside it to be free. No step may raise cost plus heuristic by 2^18.

    Return whether there is a way; if not, all cells that can be reached have been. And the first and last row and
    column with costs. Raises ValueError, and MemoryError.
    """
    grid, columns = _walled(weights, steps, start, goal)
    box = ffi.new("int64_t[4]")
    made = _given("costs", costs, _UINT32, *weights.shape, out=True)
    found = lib.search(grid, columns, start, goal, steps, made, box)
    if found < 0:
        costs.fill(UNREACHED)
        raise MemoryError("no room for the queue of a search")
    return bool(found), list(box)


def trace(weights: Bytes, start: int, goal: int, steps: Steps, costs: Counts) -> Cells:
    """The cells (n) of the way that `search` has found, from the goal back to the start. Raises ValueError."""
    grid, columns = _walled(weights, steps, start, goal)
    found = _given("costs", costs, _UINT32, *weights.shape)
    # No step costs less than a straight one at the least weight.
    out = np.empty(int(costs[divmod(goal, columns)]) // (steps.straight * max(1, steps.least)) + 1, np.int64)
    made = _given("out", out, _INT64, len(out), out=True)
    count = lib.trace(grid, columns, start, goal, steps, found, made, len(out))
    if not count:
        raise ValueError("costs: they lead from the goal to no start")
    return out[:count]


def _points(name: str, cells: Cells, weights: Bytes) -> Any:
    """The memory of cells (n, 2) as (column, row). Raises ValueError unless the grid has them."""
    given = _given(name, cells, _INT64, len(cells), 2)
    for axis in (0, 1):
        _within(name, cells[:, axis], 0, weights.shape[1 - axis])
    return given


def measure_lines(weights: Bytes, begins: Cells, ends: Cells) -> Floats:
    """Cost (n) of each line between the middles of cells (n, 2) as (column, row); inf where it is blocked.

    It is the integral of `weights` (rows, columns) along the line: weight times cells. A line is followed through every
    cell that it touches, so it goes through no cell that a step could not enter. Raises ValueError.
    """
    grid, _, columns = _grid("weights", weights, _UINT8)
    out = np.empty(len(begins))
    if begins.shape != ends.shape:
        raise ValueError(f"ends: {ends.shape} is not {begins.shape}")
    lines = _points("begins", begins, weights), _points("ends", ends, weights), len(begins)
    lib.measure_lines(grid, columns, *lines, _given("out", out, _DOUBLE, len(out), out=True))
    return out


def shorten(weights: Bytes, way: Cells, stride: int, reach: int, least: float) -> tuple[Floats, Cells]:
    """The cheapest way along lines between cells of `way` (n, 2; column, row), each a neighbour of the one before.

    Lines join every `stride`th cell, and the last, to such cells up to `reach` cells before. Return what the way to
    each cell costs (n), and the index of the cell from which its last line comes (n), -1 for the first. `least` is the
    least of `weights` (rows, columns) other than 0. Raises ValueError.
    """
    grid, _, columns = _grid("weights", weights, _UINT8)
    count = len(way)
    if not count or stride < 1 or reach < 0:
        raise ValueError(f"way, stride, reach: {count} cells, {stride}, {reach}")
    best, before = np.empty(count), np.empty(count, np.int64)
    out = _given("best", best, _DOUBLE, count, out=True), _given("before", before, _INT64, count, out=True)
    lib.shorten(grid, columns, _points("way", way, weights), count, stride, reach, least, *out)
    return best, before


# particles.c: localisation

BeamEnds = NDArray[np.float32]
"""(2, m): where beams end in the base frame, in cells, along x and along y."""


def move_poses(poses: Floats, motion: Sequence[float], draws: Floats) -> None:
    """Turn, drive and turn: move poses (n, 3; metres, radians) in place.

    `motion` is the first turn, the way, the last turn, and the deviation of each, by which `draws` (n, 3) count. Raises
    ValueError.
    """
    count = len(poses)
    if len(motion) != 6:
        raise ValueError(f"motion: {len(motion)} numbers are not 6")
    places = _given("poses", poses, _DOUBLE, count, 3, out=True)
    lib.move_poses(places, count, motion, _given("draws", draws, _DOUBLE, count, 3))


def _likelihoods(values: NDArray[np.uint16], place: tuple[float, float, float, float]) -> Any:
    given, rows, columns = _grid("values", values, _UINT16)
    if not values.size or max(values.shape) > 1 << 24 or values.size >= 1 << 31 or not place[3] > 0.0:
        raise ValueError(f"values, place: {values.shape} cells, or {place[3]} metres a cell")
    x, y, yaw, cell = place
    # The struct does not keep the memory: its caller does.
    return ffi.new("likelihoods *", (given, rows, columns, x, y, yaw, math.cos(yaw), math.sin(yaw), cell))


def sum_poses(
    values: NDArray[np.uint16], place: tuple[float, float, float, float], poses: Floats, beams: BeamEnds
) -> NDArray[np.int64]:
    """Sums (n) of a map's `values` (rows + 2, columns + 2: it has a border) where the beams of poses (n, 3) end.

    `place` is the map's lower left corner x, y, yaw in `map` and the metres of a cell; poses are x, y (metres), yaw in
    `map`. What is outside counts as the border. Places have seven digits. Raises ValueError.
    """
    count, many = len(poses), beams.shape[-1]
    out = np.empty(count, np.int64)
    places = _given("poses", poses, _DOUBLE, count, 3), count, _given("beams", beams, _FLOAT, 2, many), many
    lib.sum_poses(_likelihoods(values, place), *places, _given("out", out, _INT64, count, out=True))
    return out


def climb(
    values: NDArray[np.uint16], place: tuple[float, float, float, float], poses: Floats, beams: BeamEnds,
    steps: tuple[float, float], halvings: int, most: int,
) -> NDArray[np.int64]:  # fmt: skip
    """Move each of `poses` (n, 3) to a place near by where the beams are likeliest (`sum_poses`): a pattern search.

    It looks at the 26 neighbours at a distance of `steps` (metres, radians), goes to the best one, and halves the steps
    where none is better, so many times, in at most `most` rounds. Return the sums of values (n). Raises ValueError.
    """
    count, many = len(poses), beams.shape[-1]
    sums = np.empty(count, np.int64)
    places = _given("poses", poses, _DOUBLE, count, 3, out=True), count, _given("beams", beams, _FLOAT, 2, many), many
    out = _given("sums", sums, _INT64, count, out=True)
    lib.climb(_likelihoods(values, place), *places, *steps, halvings, most, out)
    return sums


def _table(count: int) -> tuple[Any, int]:
    """The memory of an empty hash table for up to so many bins, and the mask of its rows."""
    table = np.full(1 << (2 * count).bit_length(), np.iinfo(np.int64).min)
    return _given("table", table, _INT64, len(table), out=True), len(table) - 1


Size = tuple[float, float, float]
"""Of a bin of particles: metres, metres, radians."""


def resample(
    poses: Floats, sums: Floats, draws: Floats, strange: NDArray[np.bool_], enough: Cells, size: Size
) -> Floats:
    """Particles (up to m, 3) that are drawn from `poses` (n or more, 3) until there are `enough` (k) for their bins.

    `sums` (n) are the running sums of the weights, up to 1, and `draws` (m) uniform numbers: each means the first
    particle whose sum is above it. Where `strange` (m) is true the ith comes from row n + i of `poses` instead. Raises
    ValueError.
    """
    count, most = len(sums), len(draws)
    if not count or not len(enough) or len(poses) < count + (most if strange.any() else 0) or min(size) <= 0.0:
        raise ValueError(f"poses, sums, enough, size: {len(poses)}, {count}, {len(enough)} elements, and {size}")
    guide, out = np.empty(count, np.int64), np.empty((most, 3))
    found = lib.resample(
        _given("poses", poses, _DOUBLE, len(poses), 3), _given("sums", sums, _DOUBLE, count), count,
        _given("draws", draws, _DOUBLE, most), _given("strange", strange, _BOOL, most), most,
        _given("enough", enough, _INT64, len(enough)), len(enough), size, *_table(most),
        _given("guide", guide, _INT64, count, out=True), _given("out", out, _DOUBLE, most, 3, out=True),
    )  # fmt: skip
    return out[:found]


def find_cluster(poses: Floats, weights: Floats, size: Size, turns: int) -> tuple[Cells, Floats, Floats]:
    """Clusters of particles (n, 3): those whose bins touch, if only at a corner. Return labels (n), the same in each.

    Also the moments (4, 4) of the heaviest one: the sums of weight times products of 1, x, y, turn, counted from the
    heaviest of its particles; and that particle (3). `turns` bins make a full turn. Raises ValueError.
    """
    count = len(poses)
    if not (count and 0 < turns <= 64 and min(size) > 0.0):
        raise ValueError(f"poses, turns, size: {count} poses, {turns}, {size}")
    table, mask = _table(count)
    cluster, stack, labels = np.empty(mask + 1, np.int64), np.empty(count, np.int64), np.empty(count, np.int64)
    totals, moments = np.zeros(count), np.zeros(19)
    lib.find_cluster(
        _given("poses", poses, _DOUBLE, count, 3), _given("weights", weights, _DOUBLE, count), count, size, turns,
        table, mask, _given("cluster", cluster, _INT64, mask + 1, out=True),
        _given("stack", stack, _INT64, count, out=True), _given("totals", totals, _DOUBLE, count, out=True),
        _given("labels", labels, _INT64, count, out=True), _given("moments", moments, _DOUBLE, 19, out=True),
    )  # fmt: skip
    return labels, moments[:16].reshape(4, 4), moments[16:]


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
