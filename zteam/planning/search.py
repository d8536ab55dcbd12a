"""Ways over a grid of weights: the memory of searches, and what is asked of them."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from zteam.kernels.binding import UNREACHED, Cells, Steps, measure_lines, search, trace, weigh_cells
from zteam.planning.costs import INSCRIBED_INFLATED_OBSTACLE, Costs
from zteam.planning.shortening import make_any_angle

COSTMAP_STEPS = (70, 99)
"""A diagonal step is √2 straight ones, less a hundredth of a percent; small, so that long ways fit into 32 bits."""
OCTILE_STEPS = (985, 1393)
"""For plain grids: √2 to less than a millionth."""


class Field:
    """Weights of a grid's cells, and the memory of searches on it. Keep it: making it costs as much as a search."""

    def __init__(self, rows: int, columns: int) -> None:
        self.shape = rows, columns
        self.steps = Steps(*OCTILE_STEPS, 1)
        self._weights = np.zeros((rows + 2, columns + 2), np.uint8)
        self._costs = np.full((rows + 2, columns + 2), UNREACHED, np.uint32)

    def set_free(self, free: NDArray[np.bool_]) -> None:
        """A plain grid: cells (rows, columns) can be entered, at the cost of the way, or cannot."""
        self._weights[1:-1, 1:-1] = free
        self.steps = Steps(*OCTILE_STEPS, 1)

    def set_costs(
        self,
        costs: Costs,
        neutral: int,
        factor: float,
        allow_unknown: bool,
        barred: int = INSCRIBED_INFLATED_OBSTACLE,
    ) -> None:
        """A costmap: a cell weighs `neutral` + `factor` · its cost; those from the cost `barred` on cannot be entered.

        Unknown cells weigh as much as the dearest ones that can, or cannot be entered. Weights are cut to whole
        numbers from 1 to 255: raises ValueError for others.
        """
        heaviest = neutral + int(factor * 256.0) * (INSCRIBED_INFLATED_OBSTACLE - 1) // 256
        if not (neutral >= 1 and factor >= 0.0 and heaviest <= 255):
            raise ValueError(f"weights must lie from 1 to 255, not from {neutral} to {heaviest}")
        weigh_cells(costs, neutral, int(factor * 256.0), barred, heaviest if allow_unknown else 0, self._weights)
        self.steps = Steps(*COSTMAP_STEPS, neutral)

    def is_free(self, row: int, column: int) -> bool:
        """Whether a cell can be entered; one outside cannot."""
        rows, columns = self.shape
        return 0 <= row < rows and 0 <= column < columns and bool(self._weights[row + 1, column + 1])

    def nearest_free(self, cell: tuple[int, int], tolerance: float) -> tuple[int, int] | None:
        """The cell (row, column) nearest to this one that can be entered, up to `tolerance` cells from it."""
        found = self._nearest(self._weights, 0, cell, tolerance)
        return None if found is None else (found // (self.shape[1] + 2) - 1, found % (self.shape[1] + 2) - 1)

    def find_way(self, start: tuple[int, int], goal: tuple[int, int], tolerance: float = 0.0) -> Cells | None:
        """The cheapest way between two cells (row, column): (n, 2) as (column, row), each beside the one before.

        If there is none, the way to the cell nearest to the goal that can be reached, up to `tolerance` cells from it.
        None if there is no way at all. Raises ValueError for a start that cannot be entered.
        """
        if not self.is_free(*start):
            raise ValueError(f"the start, row {start[0]}, column {start[1]}, cannot be entered")
        stride = self.shape[1] + 2
        begin = (start[0] + 1) * stride + start[1] + 1
        end = self._nearest(self._weights, 0, goal, tolerance)
        if end is None:
            return None
        found, (low, high, left, right) = search(self._weights, begin, end, self.steps, self._costs)
        if not found:
            # All that can be reached has been.
            end = self._nearest(self._costs, UNREACHED, goal, tolerance)
        cells = None if end is None else trace(self._weights, begin, end, self.steps, self._costs)
        self._costs[low : high + 1, left : right + 1] = UNREACHED
        if cells is None:
            return None
        y, x = np.divmod(cells[::-1], stride)
        return np.stack((x - 1, y - 1), axis=1)

    def _nearest(self, cells: NDArray[Any], nothing: int, goal: tuple[int, int], tolerance: float) -> int | None:
        """The index of the cell other than `nothing` that is nearest to the goal, up to `tolerance` cells from it."""
        reach = int(tolerance)
        low, left = max(0, goal[0] + 1 - reach), max(0, goal[1] + 1 - reach)
        part = cells[low : max(0, goal[0] + 2 + reach), left : max(0, goal[1] + 2 + reach)]
        found = np.argwhere(part != nothing) + np.array((low, left))
        away = ((found - np.array(goal) - 1) ** 2).sum(axis=1)
        if not len(found) or away.min() > tolerance * tolerance:
            return None
        row, column = found[away.argmin()].tolist()
        return int(row * cells.shape[1] + column)

    def shorten(self, way: Cells) -> Cells:
        """The corners of a way of straight lines (n, 2) that costs no more than a way from cell to cell."""
        if len(way) < 3:
            return way
        return make_any_angle(self._weights, way + 1, self.steps.least) - 1

    def cost_of(self, corners: Cells) -> float:
        """Cost of the straight lines between these cells (n, 2): weight times cells; inf where they are blocked."""
        if len(corners) < 2:
            return 0.0
        points = np.ascontiguousarray(corners + 1)
        return float(measure_lines(self._weights, points[:-1], points[1:]).sum())


def length_of(corners: Cells) -> float:
    """Length of the straight lines between cells, in cells."""
    return float(np.hypot(*np.diff(corners, axis=0).T).sum())
