"""Grids: cells in the plane, row by row from the origin, as nav_msgs/OccupancyGrid has them."""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from zteam.geometry import Pose2

Floats = NDArray[np.float64]
Cells = NDArray[np.int64]
"""(n, 2): row and column."""

NOWHERE = Pose2(0.0, 0.0, 0.0)
"""An origin that turns and moves nothing."""


class GridGeometry(NamedTuple):
    """Where the cells of a grid lie. Row 0 and column 0 meet at the origin."""

    rows: int
    columns: int
    resolution: float
    """Metres a cell."""
    origin: Pose2 = NOWHERE
    """The outer corner of cell (0, 0), with the direction of the rows, in the frame of the map."""

    def cell_at(self, x: float, y: float) -> tuple[int, int]:
        """(row, column) of the cell that holds a point (metres, in `map`), whether the grid has this cell or not."""
        u, v = self.to_cells(x, y)
        return math.floor(v), math.floor(u)

    @property
    def place(self) -> tuple[float, ...]:
        """x, y, cosine and sine of the origin, metres a cell, and the origin's yaw."""
        x, y, yaw = self.origin
        return x, y, math.cos(yaw), math.sin(yaw), self.resolution, yaw

    def holds(self, row: int, column: int) -> bool:
        return 0 <= row < self.rows and 0 <= column < self.columns

    def to_cells(self, x: float, y: float) -> tuple[float, float]:
        """(u, v): a point (metres, in `map`) in cells from the origin, along the columns and along the rows."""
        cos, sin = math.cos(self.origin.yaw), math.sin(self.origin.yaw)
        dx, dy = x - self.origin.x, y - self.origin.y
        return (cos * dx + sin * dy) / self.resolution, (cos * dy - sin * dx) / self.resolution

    def from_cells(self, u: float, v: float) -> tuple[float, float]:
        """(x, y) in `map` of a point in cells from the origin: the inverse of `to_cells`."""
        cos, sin = math.cos(self.origin.yaw), math.sin(self.origin.yaw)
        dx, dy = u * self.resolution, v * self.resolution
        return self.origin.x + cos * dx - sin * dy, self.origin.y + sin * dx + cos * dy

    def centre_of(self, row: int, column: int) -> tuple[float, float]:
        """(x, y) in `map` of the middle of a cell."""
        return self.from_cells(column + 0.5, row + 0.5)

    def points_to_cells(self, points: Floats) -> Floats:
        """`to_cells` for many points: (n, 2) to (n, 2)."""
        parts: Any = points.T
        return np.stack(self.to_cells(*parts), axis=1)

    def points_from_cells(self, cells: Floats) -> Floats:
        """`from_cells` for many points: (n, 2) to (n, 2)."""
        parts: Any = cells.T
        return np.stack(self.from_cells(*parts), axis=1)


class GridMap(NamedTuple):
    """A map: what is known of each cell."""

    frame: GridGeometry
    cells: NDArray[np.int8]
    """(rows, columns): 0 free to 100 occupied, -1 unknown; row 0 is the row at the origin."""


def make_map(cells: NDArray[np.int8], resolution: float, origin: Pose2 = NOWHERE) -> GridMap:
    """A map of these cells (rows, columns). Raises ValueError for other shapes, and for no resolution or place."""
    if cells.ndim != 2 or not cells.size or not 0.0 < resolution < math.inf or not all(map(math.isfinite, origin)):
        given = f"an array {cells.shape}, {resolution} m and {tuple(origin)}"
        raise ValueError(f"a map is an array (rows, columns) with metres a cell and a finite origin, not {given}")
    rows, columns = cells.shape
    return GridMap(GridGeometry(rows, columns, resolution, origin), np.ascontiguousarray(cells, np.int8))
