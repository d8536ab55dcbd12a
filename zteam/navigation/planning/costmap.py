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
from zteam.kernels.navigation import MAX_CELLS, Layers, Window
from zteam.navigation.planning.grid import GridGeometry, GridMap
from zteam.navigation.planning.scans import Scan, Teammate

Costs = Bytes
"""(rows, columns)."""

FREE_SPACE = 0
MAX_NON_OBSTACLE = 252
INSCRIBED_INFLATED_OBSTACLE = 253
"""A robot whose centre is here touches an obstacle, however it is turned."""
LETHAL_OBSTACLE = 254
NO_INFORMATION = 255

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
        radius = self.options.inflation_radius
        # As Costmap2D::cellDistance of Nav2.
        reach = max(0, math.ceil(radius / frame.resolution))
        if reach > MAX_CELLS:
            cells = f"{reach} cells of {frame.resolution:g} m"
            raise ValueError(f"inflation_radius {radius:g} is {cells}: at most {MAX_CELLS}")
        # By squared distance in cells, up to that of one cell beyond the radius.
        table = np.full((reach + 1) ** 2 + 1, FREE_SPACE, np.uint8)
        inscribed, scale = footprint.inscribed_radius, self.options.cost_scaling_factor
        for square in range(reach**2 + 1):
            table[square] = inflated_cost(math.sqrt(square) * frame.resolution, inscribed, scale)
        # The cost from which on a cell without information becomes known.
        unknown_from = FREE_SPACE + 1 if self.options.inflate_unknown else INSCRIBED_INFLATED_OBSTACLE
        shape = frame.rows, frame.columns
        self.layers = Layers(shape, footprint.corners, footprint.circumscribed_radius, table, unknown_from)
        self.layers.lie(frame.place)
        self.costs: Costs = self.layers.costs
        """The costs of all layers, inflated, (rows, columns). Read it; `update` writes it."""
        self._teammates: tuple[Teammate, ...] = ()

    def set_map(self, grid: GridMap) -> None:
        """Take the static layer from a map of the same frame. Raises ValueError for another one."""
        if grid.frame != self.frame:
            raise ValueError(f"a costmap of {self.frame} cannot take a map of {grid.frame}")
        # StaticLayer::interpretValue of Nav2 with `trinary_costmap`.
        fixed = self.layers.fixed
        fixed[:] = np.where(grid.cells >= min(100, self.options.lethal_cost_threshold), LETHAL_OBSTACLE, FREE_SPACE)
        if self.options.track_unknown_space:
            fixed[grid.cells < 0] = NO_INFORMATION
        self.layers.change_all()

    def move(self, frame: GridGeometry, rows: int, columns: int) -> None:
        """Lie elsewhere, with as many cells: what was cell (`rows`, `columns`) is (0, 0) now.

        What lasers have seen keeps its place. There must be no static layer.
        """
        self.frame = frame
        self.layers.lie(frame.place)
        self.layers.move(rows, columns)

    def observe(self, scan: Scan, base: Pose2, teammates: Iterable[Teammate] = ()) -> None:
        """Clear and mark cells as a scan of a robot at `base` says; what it has met on a teammate is not marked."""
        options = self.options
        limits = options.raytrace_max_range, options.obstacle_max_range
        self.layers.observe(scan, base, teammates, options.teammate_margin, limits)

    def clear_footprint(self, base: Pose2) -> None:
        """Take what lasers have seen away from under a robot at `base`."""
        self.layers.clear(base)

    def clear_around(self, base: Pose2, distance: float) -> None:
        """Forget what lasers have seen up to `distance` (m) from a robot at `base` (ClearCostmapAroundRobot)."""
        self.layers.change((base.x, base.y, distance), forget=True)

    def set_teammates(self, teammates: Iterable[Teammate]) -> None:
        """Teammates stand here now, and nowhere else; they are obstacles."""
        new = tuple(teammates)
        if new != self._teammates:
            for mate in {*self._teammates, *new} - ({*self._teammates} & {*new}):
                self.layers.change(mate)
            self._teammates = new

    def update(self) -> Window | None:
        """Bring `costs` up to date; return the rows and columns that may have changed, if any."""
        return self.layers.update(self._teammates)

    def cost_of_distance(self, distance: float) -> int:
        """The cost of a cell at this distance (m) from an obstacle, or at the inflation radius if that is less."""
        distance = min(max(distance, 1e-9), self.options.inflation_radius)
        return inflated_cost(distance, self.footprint.inscribed_radius, self.options.cost_scaling_factor)

    def cost_at(self, x: float, y: float) -> int:
        """The cost at a point (metres, in the frame of the map); outside it is LETHAL_OBSTACLE."""
        return self.layers.cost_at(x, y)


def make_costmap(grid: GridMap, footprint: Footprint, options: CostmapOptions | None = None) -> Costmap:
    """The costmap of a map, up to date."""
    costmap = Costmap(grid.frame, footprint, options)
    costmap.set_map(grid)
    costmap.update()
    return costmap
