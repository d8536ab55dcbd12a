"""Costmaps in layers: the static map, what lasers have seen, teammates where they are now, and inflation.

Names, values and defaults are those of nav2_costmap_2d; layers are joined by its `updateWithMax`. Distances to
obstacles are exact, from centre to centre of cells (Nav2 spreads from cell to cell: that is off by a cell in places).
"""

import math
from collections.abc import Iterable, Sequence
from typing import Annotated, NamedTuple

import msgspec
import numpy as np

from zteam.config.numbers import NotNegative
from zteam.config.problems import CheckedOptions
from zteam.geometry import Pose2, in_polygon
from zteam.kernels.binding import Bytes, Floats
from zteam.kernels.navigation import MAX_CELLS, Window, fill_disc, fill_outline, inflate, observe
from zteam.navigation.planning.grid import GridGeometry, GridMap
from zteam.navigation.planning.scans import Scan, Teammate, find_ends

Costs = Bytes
"""(rows, columns)."""

FREE_SPACE = 0
MAX_NON_OBSTACLE = 252
INSCRIBED_INFLATED_OBSTACLE = 253
"""A robot whose centre is here touches an obstacle, however it is turned."""
LETHAL_OBSTACLE = 254
NO_INFORMATION = 255

_BEHIND = 0.25
"""Cells from the end of a beam to the point whose cell is marked."""
_CORNERS_OF_CIRCLE = 16


class Footprint(NamedTuple):
    """A robot's outline in its base frame, as a polygon in metres."""

    corners: Floats
    """(n, 2), in order; a circle has 16 that lie outside of it."""
    inscribed_radius: float
    """Distance of the origin to the nearest point of the outline; 0 if the origin is outside."""
    circumscribed_radius: float
    """Distance to the farthest one."""
    half_width: float
    """How far it reaches to its wider side."""


def make_footprint(corners: Sequence[Sequence[float]] | Floats, padding: float = 0.0) -> Footprint:
    """A footprint of corners (metres), each `padding` farther out along both axes, as in Nav2. Raises ValueError."""
    points = np.array(corners, np.float64)
    if points.ndim != 2 or points.shape[0] < 3 or points.shape[1] != 2 or not np.isfinite(points).all():
        raise ValueError("a footprint is a list of three corners [x, y] or more, in metres")
    points = points + padding * np.sign(points)
    along = np.roll(points, -1, axis=0) - points
    square = np.maximum((along * along).sum(axis=1), 1e-300)
    # On each side the point that is nearest to the origin.
    share = np.clip(-(points * along).sum(axis=1) / square, 0.0, 1.0)
    nearest = float(np.hypot(*(points + share[:, None] * along).T).min()) if in_polygon(points, 0.0, 0.0) else 0.0
    farthest, width = float(np.hypot(points[:, 0], points[:, 1]).max()), float(np.abs(points[:, 1]).max())
    return Footprint(points, nearest, farthest, width)


def make_circle(radius: float, padding: float = 0.0) -> Footprint:
    """The footprint of a round robot. Raises ValueError for a radius that is not above 0."""
    if not 0.0 < radius < math.inf:
        raise ValueError(f"a robot's radius is above 0 m, not {radius}")
    turns = (np.arange(_CORNERS_OF_CIRCLE) + 0.5) * (2.0 * math.pi / _CORNERS_OF_CIRCLE)
    outer = (radius + padding) / math.cos(math.pi / _CORNERS_OF_CIRCLE)
    points = outer * np.stack((np.cos(turns), np.sin(turns)), axis=1)
    return Footprint(points, radius + padding, outer, radius + padding)


def place(footprint: Footprint, x: float, y: float, yaw: float) -> Floats:
    """The corners (n, 2) of a robot at this pose."""
    cos, sin = math.cos(yaw), math.sin(yaw)
    px, py = footprint.corners[:, 0], footprint.corners[:, 1]
    return np.stack((x + cos * px - sin * py, y + sin * px + cos * py), axis=1)


class CostmapOptions(CheckedOptions, frozen=True):
    """Parameters, with the names that Nav2 gives them in its layers."""

    inflation_radius: NotNegative = 0.7
    """Metres from an obstacle up to which cells cost something."""
    cost_scaling_factor: NotNegative = 10.0
    """1/m: how fast the cost falls beyond the inscribed radius."""
    inflate_unknown: bool = False
    lethal_cost_threshold: Annotated[int, msgspec.Meta(ge=1, le=255)] = 100
    """A map's cell is an obstacle from this value on; as in Nav2, more than 100 is 100."""
    track_unknown_space: bool = True
    """Whether unknown cells of a map stay unknown; else they are free."""
    obstacle_max_range: NotNegative = 2.5
    """Metres up to which what a laser meets is marked."""
    raytrace_max_range: NotNegative = 3.0
    """Metres up to which its beams clear cells."""
    teammate_margin: NotNegative = 0.1
    """Metres beside a teammate that still count as the teammate, when a laser meets it."""


def inflated_cost(distance: float, inscribed_radius: float, cost_scaling_factor: float) -> int:
    """The cost of a cell at a distance (m) from the nearest lethal one, as InflationLayer::computeCost of Nav2."""
    if distance == 0.0:
        return LETHAL_OBSTACLE
    if distance <= inscribed_radius:
        return INSCRIBED_INFLATED_OBSTACLE
    return int(MAX_NON_OBSTACLE * math.exp(-cost_scaling_factor * (distance - inscribed_radius)))


class Costmap:
    """The cost of each cell for one robot. Change layers, then `update`."""

    def __init__(self, frame: GridGeometry, footprint: Footprint, options: CostmapOptions | None = None) -> None:
        """Raises ValueError for an inflation radius of more than MAX_CELLS cells."""
        self.frame, self.footprint, self.options = frame, footprint, options or CostmapOptions()
        shape = frame.rows, frame.columns
        self.costs: Costs = np.full(shape, FREE_SPACE, np.uint8)
        """The costs of all layers, inflated, (rows, columns). Read it; `update` writes it."""
        self.base: Costs = np.full(shape, FREE_SPACE, np.uint8)
        """All layers before inflation."""
        self._static: Costs = np.full(shape, FREE_SPACE, np.uint8)
        self._seen: Costs = np.full(shape, NO_INFORMATION, np.uint8)
        self._teammates: tuple[Teammate, ...] = ()
        self._changed: Window | None = (0, frame.rows, 0, frame.columns)
        radius = self.options.inflation_radius
        # As Costmap2D::cellDistance of Nav2.
        self._reach = max(0, math.ceil(radius / frame.resolution))
        if self._reach > MAX_CELLS:
            cells = f"{self._reach} cells of {frame.resolution:g} m"
            raise ValueError(f"inflation_radius {radius:g} is {cells}: at most {MAX_CELLS}")
        # By squared distance in cells, up to that of one cell beyond the radius.
        self._table = np.full((self._reach + 1) ** 2 + 1, FREE_SPACE, np.uint8)
        inscribed, scale = footprint.inscribed_radius, self.options.cost_scaling_factor
        for square in range(self._reach**2 + 1):
            self._table[square] = inflated_cost(math.sqrt(square) * frame.resolution, inscribed, scale)

    def set_map(self, grid: GridMap) -> None:
        """Take the static layer from a map of the same frame. Raises ValueError for another one."""
        if grid.frame != self.frame:
            raise ValueError(f"a costmap of {self.frame} cannot take a map of {grid.frame}")
        # StaticLayer::interpretValue of Nav2 with `trinary_costmap`.
        self._static = np.full(grid.cells.shape, FREE_SPACE, np.uint8)
        self._static[grid.cells >= min(100, self.options.lethal_cost_threshold)] = LETHAL_OBSTACLE
        if self.options.track_unknown_space:
            self._static[grid.cells < 0] = NO_INFORMATION
        self._whole()

    def move(self, frame: GridGeometry, rows: int, columns: int) -> None:
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
        laser, options = base.compose(scan.sensor), self.options
        mates = [(mate.x, mate.y, mate.radius + options.teammate_margin) for mate in teammates]
        # A beam ends on the surface, between two cells: what it has met is in the one behind.
        limits = options.raytrace_max_range, options.obstacle_max_range, _BEHIND * self.frame.resolution
        self._widen(observe(self._seen, self.frame.place, laser[:2], points, met, mates, limits))

    def clear_footprint(self, base: Pose2) -> None:
        """Take what lasers have seen away from under a robot at `base`."""
        self._widen(fill_outline(self._seen, self.frame.place, self.footprint.corners, base, FREE_SPACE))

    def clear_around(self, base: Pose2, distance: float) -> None:
        """Forget what lasers have seen up to `distance` (m) from a robot at `base` (ClearCostmapAroundRobot)."""
        self._fill(self._seen, Teammate(base.x, base.y, distance), NO_INFORMATION)
        self._widen(self._window_of(Teammate(base.x, base.y, distance)))

    def set_teammates(self, teammates: Iterable[Teammate]) -> None:
        """Teammates stand here now, and nowhere else; they are obstacles."""
        new = tuple(teammates)
        if new != self._teammates:
            for mate in {*self._teammates, *new} - ({*self._teammates} & {*new}):
                self._widen(self._window_of(mate))
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
            self._fill(self.base, mate, LETHAL_OBSTACLE)
        window = self._clip(window, self._reach)
        # The cost from which on a cell without information becomes known.
        unknown_from = FREE_SPACE + 1 if self.options.inflate_unknown else INSCRIBED_INFLATED_OBSTACLE
        inflate(self.base, self._table, self._reach, window, unknown_from, self.costs)
        return window

    def cost_of_distance(self, distance: float) -> int:
        """The cost of a cell at this distance (m) from an obstacle, or at the inflation radius if that is less."""
        distance = min(max(distance, 1e-9), self.options.inflation_radius)
        return inflated_cost(distance, self.footprint.inscribed_radius, self.options.cost_scaling_factor)

    def cost_at(self, x: float, y: float) -> int:
        """The cost at a point (metres, in the frame of the map); outside it is LETHAL_OBSTACLE."""
        cell = self.frame.cell_at(x, y)
        return int(self.costs[cell]) if self.frame.holds(*cell) else LETHAL_OBSTACLE

    def _fill(self, layer: Costs, disc: Teammate, cost: int) -> None:
        fill_disc(layer, *self.frame.to_cells(disc.x, disc.y), disc.radius / self.frame.resolution, cost)

    def _window_of(self, disc: Teammate) -> Window | None:
        """The cells of the grid that a disc may touch, if any."""
        (u, v), reach = self.frame.to_cells(disc.x, disc.y), disc.radius / self.frame.resolution
        window = math.floor(v - reach), math.floor(v + reach) + 1, math.floor(u - reach), math.floor(u + reach) + 1
        low, high, left, right = self._clip(window, 0)
        return (low, high, left, right) if low < high and left < right else None

    def _whole(self) -> None:
        self._changed = 0, self.frame.rows, 0, self.frame.columns

    def _widen(self, window: Window | None) -> None:
        """Note that the layers have changed within a window."""
        if window is not None:
            old = self._changed or window
            low, high = min(window[0], old[0]), max(window[1], old[1])
            self._changed = low, high, min(window[2], old[2]), max(window[3], old[3])

    def _clip(self, window: Window, more: int) -> Window:
        """The part of a window, `more` cells wider on each side, that lies in the grid."""
        rows, columns = self.frame.rows, self.frame.columns
        low, high = max(0, min(rows, window[0] - more)), max(0, min(rows, window[1] + more))
        left, right = max(0, min(columns, window[2] - more)), max(0, min(columns, window[3] + more))
        return low, max(low, high), left, max(left, right)


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
