"""Costmaps in layers: the static map, what lasers have seen, teammates where they are now, and inflation.

Names and defaults are those of nav2_costmap_2d; layers are joined by its `updateWithMax`.
"""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from zteam.geometry import Pose2
from zteam.kernels.binding import Window, inflate, trace_beams
from zteam.planning.costs import FREE_SPACE, LETHAL_OBSTACLE, NO_INFORMATION, Costs, inflated_cost
from zteam.planning.footprint import Footprint, place
from zteam.planning.grid import Frame, GridMap
from zteam.planning.inflation import cost_table, radius_in_cells, threshold_of_unknown
from zteam.planning.polygons import cells_of_disc, cells_of_polygon
from zteam.planning.scans import Scan, Teammate, find_ends, on_teammates

_BEHIND = 0.25
"""Cells from the end of a beam to the point whose cell is marked."""


class CostmapOptions(NamedTuple):
    """Parameters, with the names that Nav2 gives them in its layers."""

    inflation_radius: float = 0.7
    """Metres from an obstacle up to which cells cost something."""
    cost_scaling_factor: float = 10.0
    """1/m: how fast the cost falls beyond the inscribed radius."""
    inflate_unknown: bool = False
    lethal_cost_threshold: int = 100
    """A map's cell is an obstacle from this value on."""
    track_unknown_space: bool = True
    """Whether unknown cells of a map stay unknown; else they are free."""
    obstacle_max_range: float = 2.5
    """Metres up to which what a laser meets is marked."""
    raytrace_max_range: float = 3.0
    """Metres up to which its beams clear cells."""
    teammate_margin: float = 0.1
    """Metres beside a teammate that still count as the teammate, when a laser meets it."""


class Costmap:
    """The cost of each cell for one robot. Change layers, then `update`."""

    def __init__(self, frame: Frame, footprint: Footprint, options: CostmapOptions | None = None) -> None:
        self.frame = frame
        self.footprint = footprint
        self.options = options or CostmapOptions()
        shape = frame.rows, frame.columns
        self.costs: Costs = np.full(shape, FREE_SPACE, np.uint8)
        """The costs of all layers, inflated, (rows, columns). Read it; `update` writes it."""
        self.base: Costs = np.full(shape, FREE_SPACE, np.uint8)
        """All layers before inflation."""
        self._static: Costs = np.full(shape, FREE_SPACE, np.uint8)
        self._seen: Costs = np.full(shape, NO_INFORMATION, np.uint8)
        self._teammates: tuple[Teammate, ...] = ()
        self._reach = radius_in_cells(self.options.inflation_radius, frame.resolution)
        self._changed: Window | None = None
        self._tabulate()

    def _tabulate(self) -> None:
        options = self.options
        self._table = cost_table(
            options.inflation_radius,
            self.footprint.inscribed_radius,
            options.cost_scaling_factor,
            self.frame.resolution,
        )
        self._whole()

    def set_map(self, grid: GridMap) -> None:
        """Take the static layer from a map of the same frame. Raises ValueError for another one."""
        if grid.frame != self.frame:
            raise ValueError(f"a costmap of {self.frame} cannot take a map of {grid.frame}")
        self._static = interpret_map(grid, self.options)
        self._whole()

    def move(self, frame: Frame, rows: int, columns: int) -> None:
        """Lie elsewhere, with as many cells: what was cell (`rows`, `columns`) is (0, 0) now.

        What lasers have seen keeps its place. There must be no static layer.
        """
        seen = np.full_like(self._seen, NO_INFORMATION)
        height, width = seen.shape
        if abs(rows) < height and abs(columns) < width:
            to = slice(max(0, -rows), height - max(0, rows)), slice(max(0, -columns), width - max(0, columns))
            old = slice(max(0, rows), height - max(0, -rows)), slice(max(0, columns), width - max(0, -columns))
            seen[to] = self._seen[old]
        self._seen, self.frame = seen, frame
        self._whole()

    def observe(self, scan: Scan, base: Pose2, teammates: Iterable[Teammate] = ()) -> None:
        """Clear and mark cells as a scan of a robot at `base` says; what it has met on a teammate is not marked."""
        far = max(self.options.raytrace_max_range, self.options.obstacle_max_range)
        points, met = find_ends(scan, base, far)
        if not len(points):
            return
        laser = base.compose(scan.sensor)
        start = np.array([[laser.x, laser.y]])
        origin = np.floor(self.frame.points_to_cells(start)).astype(np.int64)[0]
        way = points - start
        length = np.hypot(way[:, 0], way[:, 1])
        marked = met & (length <= self.options.obstacle_max_range)
        marked &= ~on_teammates(points, teammates, self.options.teammate_margin)
        short = np.minimum(1.0, self.options.raytrace_max_range / np.maximum(length, 1e-9))
        ends = np.floor(self.frame.points_to_cells(start + way * short[:, None])).astype(np.int64)
        # A beam ends on the surface, between two cells: what it has met is in the one behind.
        behind = points + way * (_BEHIND * self.frame.resolution / np.maximum(length, 1e-9))[:, None]
        marks = np.floor(self.frame.points_to_cells(behind[marked])).astype(np.int64)
        trace_beams(self._seen, int(origin[0]), int(origin[1]), ends, marks)
        corners = np.concatenate((ends, marks, origin[None]))
        self._touch(corners)

    def clear_footprint(self, base: Pose2) -> None:
        """Take what lasers have seen away from under a robot at `base`."""
        self._note(cells_of_polygon(self.frame, place(self.footprint, *base)), FREE_SPACE)

    def clear_around(self, base: Pose2, distance: float) -> None:
        """Forget what lasers have seen up to `distance` (m) from a robot at `base` (ClearCostmapAroundRobot)."""
        self._note(cells_of_disc(self.frame, base.x, base.y, distance), NO_INFORMATION)

    def set_teammates(self, teammates: Iterable[Teammate]) -> None:
        """Teammates stand here now, and nowhere else; they are obstacles."""
        new = tuple(teammates)
        if new != self._teammates:
            for mate in {*self._teammates, *new} - ({*self._teammates} & {*new}):
                self._touch(cells_of_disc(self.frame, mate.x, mate.y, mate.radius)[:, ::-1])
            self._teammates = new

    def update(self) -> Window | None:
        """Bring `costs` up to date; return the rows and columns that may have changed, if any."""
        if self._changed is None:
            return None
        window = self._clip(self._changed, 0)
        self._changed = None
        part = slice(window[0], window[1]), slice(window[2], window[3])
        self.base[part] = _join(self._static[part], self._seen[part])
        for mate in self._teammates:
            cells = cells_of_disc(self.frame, mate.x, mate.y, mate.radius)
            self.base[cells[:, 0], cells[:, 1]] = LETHAL_OBSTACLE
        window = self._clip(window, self._reach)
        unknown_from = threshold_of_unknown(self.options.inflate_unknown)
        inflate(self.base, self._table, self._reach, window, unknown_from, self.costs)
        return window

    def cost_of_distance(self, distance: float) -> int:
        """The cost of a cell at this distance (m) from an obstacle, or at the inflation radius if that is less."""
        options = self.options
        return inflated_cost(
            max(distance, 1e-9) if distance <= options.inflation_radius else options.inflation_radius,
            self.footprint.inscribed_radius,
            options.cost_scaling_factor,
        )

    def cost_at(self, x: float, y: float) -> int:
        """The cost at a point (metres, in the frame of the map); outside it is LETHAL_OBSTACLE."""
        cell = self.frame.cell_at(x, y)
        return int(self.costs[cell]) if self.frame.holds(*cell) else LETHAL_OBSTACLE

    def _note(self, cells: NDArray[np.int64], cost: int) -> None:
        self._seen[cells[:, 0], cells[:, 1]] = cost
        self._touch(cells[:, ::-1])

    def _whole(self) -> None:
        self._changed = 0, self.frame.rows, 0, self.frame.columns

    def _touch(self, cells: NDArray[np.int64]) -> None:
        """Note that the layers have changed within the box of these cells (column, row)."""
        if not len(cells):
            return
        (left, low), (right, high) = cells.min(axis=0).tolist(), cells.max(axis=0).tolist()
        old = self._changed or (low, high + 1, left, right + 1)
        self._changed = min(low, old[0]), max(high + 1, old[1]), min(left, old[2]), max(right + 1, old[3])

    def _clip(self, window: Window, more: int) -> Window:
        """The part of a window, `more` cells wider on each side, that lies in the grid."""
        rows, columns = self.frame.rows, self.frame.columns
        low, high = max(0, min(rows, window[0] - more)), max(0, min(rows, window[1] + more))
        left, right = max(0, min(columns, window[2] - more)), max(0, min(columns, window[3] + more))
        return low, max(low, high), left, max(left, right)


def interpret_map(grid: GridMap, options: CostmapOptions) -> Costs:
    """A map's cells as costs: StaticLayer::interpretValue of Nav2 with `trinary_costmap`."""
    costs = np.where(grid.cells >= options.lethal_cost_threshold, np.uint8(LETHAL_OBSTACLE), np.uint8(FREE_SPACE))
    unknown = np.uint8(NO_INFORMATION if options.track_unknown_space else FREE_SPACE)
    return np.where(grid.cells < 0, unknown, costs)


def _join(below: Costs, above: Costs) -> Costs:
    """Costmap2D's updateWithMax: the higher cost counts, and whatever is known."""
    known = np.where(below == NO_INFORMATION, above, np.maximum(below, above))
    return np.where(above == NO_INFORMATION, below, known)


def make_costmap(grid: GridMap, footprint: Footprint, options: CostmapOptions | None = None) -> Costmap:
    """The costmap of a map, up to date."""
    costmap = Costmap(grid.frame, footprint, options)
    costmap.set_map(grid)
    costmap.update()
    return costmap
