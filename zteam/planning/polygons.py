"""Which cells (n, 2; row, column) shapes cover."""

import math

import numpy as np

from zteam.geometry import in_polygon
from zteam.kernels.binding import Cells
from zteam.planning.grid import Floats, Frame


def cells_of_disc(frame: Frame, x: float, y: float, radius: float) -> Cells:
    """The cells that a disc (metres, in `map`) touches, as far as the grid has them."""
    u, v = frame.to_cells(x, y)
    reach = radius / frame.resolution
    columns, rows = _box(frame, u - reach, v - reach, u + reach, v + reach)
    # The point of each cell that is nearest to the middle of the disc.
    du = np.maximum(np.maximum(columns - u, u - (columns + 1)), 0.0)[None, :]
    dv = np.maximum(np.maximum(rows - v, v - (rows + 1)), 0.0)[:, None]
    found = np.argwhere(du * du + dv * dv <= reach * reach)
    return _moved(found, rows, columns)


def cells_of_polygon(frame: Frame, corners: Floats) -> Cells:
    """The cells whose middle lies in a polygon (n, 2; metres, in `map`), as far as the grid has them."""
    points = frame.points_to_cells(corners)
    columns, rows = _box(frame, *points.min(axis=0), *points.max(axis=0))
    u, v = (columns + 0.5)[None, :], (rows + 0.5)[:, None]
    return _moved(np.argwhere(in_polygon(points, u, v)), rows, columns)


def _moved(found: Cells, rows: Cells, columns: Cells) -> Cells:
    return found + np.array((rows[0], columns[0])) if len(found) else found


def _box(frame: Frame, left: float, low: float, right: float, high: float) -> tuple[Cells, Cells]:
    """Columns and rows of the grid between these places in cells."""
    columns = np.arange(max(0, math.floor(left)), min(frame.columns, math.floor(right) + 1))
    rows = np.arange(max(0, math.floor(low)), min(frame.rows, math.floor(high) + 1))
    return columns, rows
