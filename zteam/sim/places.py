"""Where a floor plan's walls are: single points, and the outline of all occupied cells."""

import math

import numpy as np
from numpy.typing import NDArray

from zteam.world.model import Floorplan


def is_occupied(plan: Floorplan, x: float, y: float) -> bool:
    """Whether the point (metres in `map`) lies in an occupied cell."""
    cos, sin = math.cos(plan.pose.yaw), math.sin(plan.pose.yaw)
    dx, dy = x - plan.pose.x, y - plan.pose.y
    column = math.floor((cos * dx + sin * dy) / plan.cell[0])
    row = math.floor((cos * dy - sin * dx) / plan.cell[1])
    rows, columns = plan.occupied.shape
    return 0 <= row < rows and 0 <= column < columns and bool(plan.occupied[row, column])


def outline(occupied: NDArray[np.bool_]) -> list[tuple[tuple[int, int], tuple[int, int]]]:
    """The border of the occupied cells as maximal straight runs: ((x, y), (x, y)) in cells."""
    runs = [((x, a), (x, b)) for x, a, b in _runs(occupied.T)]
    return runs + [((a, y), (b, y)) for y, a, b in _runs(occupied)]


def _runs(occupied: NDArray[np.bool_]) -> list[tuple[int, int, int]]:
    """Runs (line, begin, end) along axis 1 where occupied and free meet across axis 0."""
    rows, columns = occupied.shape
    padded = np.zeros((rows + 2, columns), bool)
    padded[1:-1] = occupied
    border = np.zeros((rows + 1, columns + 2), np.int8)
    border[:, 1:-1] = padded[1:] != padded[:-1]
    change = np.diff(border, axis=1)
    lines, begins = np.nonzero(change == 1)
    _, ends = np.nonzero(change == -1)
    return list(zip(lines.tolist(), begins.tolist(), ends.tolist(), strict=True))
