"""The kernels of navigation (costmaps.c, search.c, particles.c), as `binding.py` says."""

import math
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from zteam.kernels.binding import Bytes, Cells, Counts, Floats, check_within, empty, ffi, lib, memory

MAX_CELLS = 180
"""Largest inflation radius in cells: the sum of two squares of it fits into 16 bits."""
_WIDEST = 10_000
"""Cells from a robot's base to its corners."""


def _grid(name: str, array: NDArray[Any], out: bool = False) -> tuple[Any, int, int]:
    """An array's memory, its rows and its columns. Raises ValueError unless it has two dimensions."""
    if array.ndim != 2:
        raise ValueError(f"{name}: {array.ndim} dimensions are not 2")
    return memory(name, array, *array.shape, out=out), array.shape[0], array.shape[1]


Window = tuple[int, int, int, int]
"""Rows from, to (not included), columns from, to."""


def square_distances(costs: Bytes, window: Window, reach: int) -> NDArray[np.uint16]:
    """Squared distances (cells) in a window of `costs` to the nearest lethal cell: exact, and up to (`reach` + 1)²."""
    grid, rows, columns = _grid("costs", costs)
    r0, r1, c0, c1 = window
    if not (0 <= r0 <= r1 <= rows and 0 <= c0 <= c1 <= columns and 0 <= reach <= MAX_CELLS):
        raise ValueError(f"window, reach: {window} is not within {rows} rows and {columns} columns, or {reach} too far")
    width = c1 - c0 + 2 * reach
    _, steps = empty(np.uint8, (r1 - r0 + 2 * reach + 1) * width)
    _, line = empty(np.uint16, width)
    squares, made = empty(np.uint16, r1 - r0, c1 - c0)
    lib.inflate(grid, rows, columns, window, reach, steps, line, made, ffi.NULL, 0, ffi.NULL)
    return squares


Places = Iterable[tuple[float, float, float]]
"""Teammates: x, y, radius in metres."""


def _scan(scan: Sequence[Any]) -> tuple[Any, int, Any]:
    """For C, with its number of beams: the ranges, first angle, increment, limits and laser of a `Scan` of planning."""
    ranges, *given, laser = scan
    array = memory("ranges", np.ascontiguousarray(ranges, np.float32), len(ranges))
    # The struct does not keep the memory: its caller does.
    return ffi.new("planar_scan *", (array, len(ranges), *given, *laser)), len(ranges), array


def _flat(mates: Places) -> tuple[Any, int]:
    parts = [part for mate in mates for part in mate]
    return ffi.new("double[]", parts), len(parts) // 3


def find_hits(
    scan: Sequence[Any], base: Sequence[float], far: float, wanted: int, mates: Places = (), margin: float = 0.0
) -> Floats:
    """Where the beams of a robot at `base` meet something up to `far` (m) away, in the frame of that pose: (n, 2).

    What is on one of `mates`, or up to `margin` (m) beside it, is left out, and so is what is too close to measure. Of
    all beams up to `wanted` are looked at, spread evenly.
    """
    seen, beams, _ranges = _scan(scan)
    ends, made = empty(np.float64, 3 * beams)
    given = base, far, min(wanted, beams), *_flat(mates), margin
    return ends[: 2 * lib.find_hits(seen, *given, made, empty(np.uint8, beams)[1])].reshape(-1, 2)


class Layers:
    """The layers of a costmap (rows, columns), for one robot. Lengths are in metres."""

    def __init__(self, shape: tuple[int, int], outline: Floats, radius: float, table: Bytes, unknown_from: int) -> None:
        """`outline` (n, 2): the robot's corners in its base frame, up to `radius` from there. `table`: costs by squared
        distance in cells, up to that of one cell beyond those that are inflated; a cell without information gets a cost
        from `unknown_from` on. Raises ValueError."""
        reach = math.isqrt(max(1, len(table) - 1)) - 1
        if reach > MAX_CELLS or not len(outline):
            raise ValueError(f"table, outline: it inflates by {reach} cells, or there are no corners")
        self.fixed, self.seen, self.base, self.costs = (np.full(shape, cost, np.uint8) for cost in (0, 255, 0, 0))
        """What the map says; what lasers have seen; both, and teammates; the same, inflated."""
        grids = [memory("shape", grid, *shape, out=True) for grid in (self.fixed, self.seen, self.base, self.costs)]
        given = memory("table", table, (reach + 1) ** 2 + 1), memory("outline", outline, len(outline), 2)
        room = empty(np.float64, 4, len(outline))[1]
        whole = 0, shape[0], 0, shape[1]
        last = given[0], reach, unknown_from, whole, given[1], len(outline), radius, room
        self._kept = grids, given, room
        self._c = ffi.new("costmap *", (*shape, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0, *grids, *last))

    def lie(self, place: Sequence[float]) -> None:
        """At `place`: x, y, cosine and sine of the origin's yaw, metres a cell, and the yaw. Raises ValueError."""
        c = self._c
        if not c.radius <= _WIDEST * place[4]:
            raise ValueError(f"place: a robot of {c.radius} m is wider than {_WIDEST} cells of {place[4]} m")
        c.x, c.y, c.cosine, c.sine, c.cell, c.yaw = place

    def move(self, rows: int, columns: int) -> None:
        """What was cell (`rows`, `columns`) is (0, 0) now. What lasers have seen keeps its place."""
        lib.move_costmap(self._c, rows, columns)

    def change_all(self) -> None:
        """Note that all cells change."""
        lib.change_all(self._c)

    def change(self, disc: tuple[float, float, float], forget: bool = False) -> None:
        """Note that what a disc (x, y, radius) touches changes; `forget` what lasers have seen there."""
        lib.change_disc(self._c, disc, forget)

    def observe(
        self, scan: Sequence[Any], base: Sequence[float], mates: Places, margin: float, limits: tuple[float, float]
    ) -> None:
        """Clear and mark cells as the beams of a robot at `base` say; what they meet on `mates` (as in `find_hits`) is
        not marked. `limits`: metres up to which a beam clears, and up to which it marks. Raises ValueError."""
        seen, beams, _ranges = _scan(scan)
        room = empty(np.float64, beams, 3)[1], empty(np.uint8, beams)[1], empty(np.int64, beams, 4)[1]
        if not lib.observe(self._c, seen, base, *_flat(mates), margin, limits, *room):
            raise ValueError("ranges: a beam ends too far away")

    def clear(self, pose: Sequence[float]) -> None:
        """Take what lasers have seen away from under the robot at a pose."""
        lib.clear_outline(self._c, pose)

    def update(self, mates: Places) -> Window | None:
        """Bring `base` and `costs` up to date where something has changed, if anything; `mates` are obstacles."""
        box = ffi.new("int64_t[4]")
        changed = lib.update_costmap(self._c, *_flat(mates), box)
        if changed < 0:
            raise MemoryError("no room to inflate a costmap")
        return tuple(box) if changed else None

    def cost_at(self, x: float, y: float) -> int:
        """The cost at a point; that of a lethal cell outside of the grid."""
        return int(lib.cost_at(self._c, x, y))

    def time_to_collision(self, pose: Sequence[float], velocity: Sequence[float], duration: float) -> float:
        """Seconds until the robot touches a lethal cell, or what is outside of the grid, that it does not touch at
        `pose`; inf if that takes longer than `duration`."""
        return float(lib.time_to_collision(self._c, pose, velocity, duration))


class PathPlace:
    """The place of a robot on a path of poses (n, 3; m, m, rad)."""

    def __init__(self, path: Floats, along: Floats) -> None:
        """`along` (n): metres from the beginning. Raises ValueError."""
        self._path = memory("path", path, len(path), 3), memory("along", along, len(path)), len(path)
        self.at = 0
        """The index of the pose."""

    def advance(self, x: float, y: float, ahead: float) -> None:
        """Go to the pose nearest to a point (m), from this one up to `ahead` metres on."""
        if self.at < self._path[2]:
            self.at = lib.find_place(*self._path, self.at, ahead, x, y)

    def leave(self, x: float, y: float, reach: float) -> int:
        """The first pose from this one on that is `reach` metres from a point or more; -1 if there is none."""
        path, _, count = self._path
        return int(lib.leave_circle(path, count, self.at, reach, x, y))


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
    grid, rows, columns = _grid("costs", costs)
    made = memory("out", out, rows + 2, columns + 2, out=True)
    check_within("neutral, factor, barred, unknown", np.array((neutral, factor, barred, unknown)), 0, 257)
    lib.weigh_cells(grid, rows, columns, neutral, factor, barred, unknown, made)


def _walled(weights: Bytes, steps: Steps, *cells: int) -> tuple[Any, int]:
    """A grid's memory and columns. Raises ValueError unless its border is 0, and those cells, which are inner, not."""
    grid, _, columns = _grid("weights", weights)
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
    made = memory("costs", costs, *weights.shape, out=True)
    found = lib.search(grid, columns, start, goal, steps, made, box)
    if found < 0:
        costs.fill(UNREACHED)
        raise MemoryError("no room for the queue of a search")
    return bool(found), list(box)


def trace(weights: Bytes, start: int, goal: int, steps: Steps, costs: Counts) -> Cells:
    """The cells (n) of the way that `search` has found, from the goal back to the start. Raises ValueError."""
    grid, columns = _walled(weights, steps, start, goal)
    found = memory("costs", costs, *weights.shape)
    # No step costs less than a straight one at the least weight.
    out, made = empty(np.int64, int(costs[divmod(goal, columns)]) // (steps.straight * max(1, steps.least)) + 1)
    count = lib.trace(grid, columns, start, goal, steps, found, made, len(out))
    if not count:
        raise ValueError("costs: they lead from the goal to no start")
    return out[:count]


def _points(name: str, cells: Cells, weights: Bytes) -> Any:
    """The memory of cells (n, 2) as (column, row). Raises ValueError unless the grid has them."""
    given = memory(name, cells, len(cells), 2)
    for axis in (0, 1):
        check_within(name, cells[:, axis], 0, weights.shape[1 - axis])
    return given


def measure_lines(weights: Bytes, begins: Cells, ends: Cells) -> Floats:
    """Cost (n) of each line between the middles of cells (n, 2) as (column, row); inf where it is blocked.

    It is the integral of `weights` (rows, columns) along the line: weight times cells. A line is followed through every
    cell that it touches, so it goes through no cell that a step could not enter. Raises ValueError.
    """
    grid, _, columns = _grid("weights", weights)
    out, made = empty(np.float64, len(begins))
    if begins.shape != ends.shape:
        raise ValueError(f"ends: {ends.shape} is not {begins.shape}")
    lines = _points("begins", begins, weights), _points("ends", ends, weights), len(begins)
    lib.measure_lines(grid, columns, *lines, made)
    return out


def straighten(weights: Bytes, way: Cells, stride: int, reach: int, spacing: int, least: float) -> Cells:
    """The corners of lines (m, 2) that cost no more than `way` (n, 2; column, row), each cell a neighbour of the one
    before. `weights` and costs are as for `measure_lines`; `least` is the least weight other than 0.

    First the cheapest way along lines that join every `stride`th cell, and the last, to such cells up to `reach` cells
    before. Then points on it, up to `spacing` cells apart, move to the side, where that is cheaper. Raises ValueError.
    """
    grid, count = _grid("weights", weights), len(way)
    if not count or stride < 1 or reach < 0 or spacing < 1:
        raise ValueError(f"way, stride, reach, spacing: {count} cells, {stride}, {reach}, {spacing}")
    # Points move by up to 12 cells to a side, then by 6, then by 3; between those that are far apart then come others.
    room = count * (2 + 27 // spacing) * (2 + 15 // spacing)
    (out, made), (_, spaced), (_, moved) = (empty(np.int64, room, 2) for _ in range(3))
    work = empty(np.float64, room, 7)[1], empty(np.int64, room, 7)[1], spaced, moved
    return out[: lib.straighten(*grid, _points("way", way, weights), count, stride, reach, spacing, least, *work, made)]


def lay_path(points: Floats, yaw: float, spacing: float) -> Floats:
    """Poses (n, 3) along lines between `points` (m, 2), up to `spacing` apart, to face the next; the last has `yaw`."""
    given = memory("points", points, len(points), 2), len(points), yaw, spacing
    if not np.abs(np.diff(points, axis=0)).max(initial=0.0) < spacing * (1 << 24):
        raise ValueError("points: they are not finite, or too far apart")
    out, made = empty(np.float64, lib.lay_path(*given, ffi.NULL), 3)
    lib.lay_path(*given, made)
    return out


# particles.c: localisation

BeamEnds = NDArray[np.float32]
"""(2, m): where beams end in the base frame, in cells, along x and along y."""


def move_poses(poses: Floats, motion: Sequence[float], draws: Floats) -> None:
    """Turn, drive and turn: move poses (n, 3; metres, radians) in place.

    `motion` is the first turn, the way, the last turn, and the deviation of each, by which `draws` (n, 3) count.
    """
    count = len(poses)
    if len(motion) != 6:
        raise ValueError(f"motion: {len(motion)} numbers are not 6")
    places = memory("poses", poses, count, 3, out=True)
    lib.move_poses(places, count, motion, memory("draws", draws, count, 3))


def _likelihoods(values: NDArray[np.uint16], place: tuple[float, float, float, float]) -> Any:
    given, rows, columns = _grid("values", values)
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
    out, made = empty(np.int64, count)
    places = memory("poses", poses, count, 3), count, memory("beams", beams, 2, many), many
    lib.sum_poses(_likelihoods(values, place), *places, made)
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
    sums, made = empty(np.int64, count)
    places = memory("poses", poses, count, 3, out=True), count, memory("beams", beams, 2, many), many
    lib.climb(_likelihoods(values, place), *places, *steps, halvings, most, made)
    return sums


def _table(count: int) -> tuple[Any, int]:
    """The memory of an empty hash table for up to so many bins, and the mask of its rows."""
    table = np.full(1 << (2 * count).bit_length(), np.iinfo(np.int64).min)
    return memory("table", table, len(table), out=True), len(table) - 1


Size = tuple[float, float, float]
"""Of a bin of particles: metres, metres, radians."""


def resample(
    poses: Floats, sums: Floats, draws: Floats, strange: NDArray[np.bool_], enough: Cells, size: Size
) -> Floats:
    """Particles (up to m, 3) that are drawn from `poses` (n or more, 3) until there are `enough` (k) for their bins.

    `sums` (n) are the running sums of the weights, up to 1, and `draws` (m) uniform numbers: each means the first
    particle whose sum is above it. Where `strange` (m) is true the ith comes from row n + i of `poses` instead.
    """
    count, most = len(sums), len(draws)
    if not count or not len(enough) or len(poses) < count + (most if strange.any() else 0) or min(size) <= 0.0:
        raise ValueError(f"poses, sums, enough, size: {len(poses)}, {count}, {len(enough)} elements, and {size}")
    _, guide = empty(np.int64, count)
    out, made = empty(np.float64, most, 3)
    found = lib.resample(
        memory("poses", poses, len(poses), 3), memory("sums", sums, count), count,
        memory("draws", draws, most), memory("strange", strange, most), most,
        memory("enough", enough, len(enough)), len(enough), size, *_table(most), guide, made,
    )  # fmt: skip
    return out[:found]


def find_cluster(poses: Floats, weights: Floats, size: Size, turns: int) -> tuple[Cells, list[float], Floats]:
    """Clusters of particles (n, 3): those whose bins touch, if only at a corner. Return labels (n), the same in each.

    Also the mean (x, y, yaw) and the covariance (3, 3) of the heaviest one. `turns` bins make a full turn. Raises
    ValueError.
    """
    count = len(poses)
    if not (count and 0 < turns <= 64 and min(size) > 0.0):
        raise ValueError(f"poses, turns, size: {count} poses, {turns}, {size}")
    table, mask = _table(count)
    (_, cluster), (_, stack), (labels, own) = empty(np.int64, mask + 1), empty(np.int64, count), empty(np.int64, count)
    (totals, sums), (covariance, made), mean = empty(np.float64, count), empty(np.float64, 3, 3), ffi.new("double[3]")
    totals[:] = 0.0
    particles = memory("poses", poses, count, 3), memory("weights", weights, count), count
    lib.find_cluster(*particles, size, turns, table, mask, cluster, stack, sums, own, mean, made)
    return labels, list(mean), covariance
