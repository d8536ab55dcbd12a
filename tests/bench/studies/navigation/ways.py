"""Plain grids for the planner's search, and what ways over cells cost."""

import numpy as np
from numpy.typing import NDArray

from zteam.kernels.binding import Cells
from zteam.kernels.navigation import Steps, measure_lines
from zteam.navigation.planning.planner import Field


def plain_field(free: NDArray[np.bool_]) -> Field:
    """A field whose cells (rows, columns) can be entered, at the cost of the way, or cannot."""
    field = Field(*free.shape)
    field.weights[1:-1, 1:-1] = free
    # √2 to less than a millionth.
    field.steps = Steps(985, 1393, 1)
    return field


def length_of(corners: Cells) -> float:
    """Length of the straight lines between cells, in cells."""
    return float(np.hypot(*np.diff(corners, axis=0).T).sum())


def cost_of(field: Field, corners: Cells) -> float:
    """Cost of the straight lines between cells (n, 2): weight times cells; inf where they are blocked."""
    points = np.ascontiguousarray(corners + 1)
    return float(measure_lines(field.weights, points[:-1], points[1:]).sum())
