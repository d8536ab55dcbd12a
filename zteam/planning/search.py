"""Ways over a grid of weights: the memory of searches, and what is asked of them."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from zteam.compiling.takeover import prepare
from zteam.planning.costs import INSCRIBED_INFLATED_OBSTACLE, NO_INFORMATION, Costs
from zteam.planning.jit import PLANNING, plainly, vectorized
from zteam.planning.lines import Cells, Floats, measure_lines
from zteam.planning.search_kernels import UNREACHED, Steps, search, trace
from zteam.planning.shortening import make_any_angle

_SHIFT = 8
"""2^(8 + 10) is more than a step at the largest weight adds to cost and heuristic together."""
_ROOM = 4096
"""Cells of a way that fit at first."""


COSTMAP_STEPS = (70, 99)
"""A diagonal step is √2 straight ones, less a hundredth of a percent; small, so that long ways fit into 32 bits."""
OCTILE_STEPS = (985, 1393)
"""For plain grids: √2 to less than a millionth."""


def _weigh_numpy(costs: Costs, neutral: int, factor: int, barred: int, unknown: int, out: NDArray[np.uint8]) -> None:
    table = np.zeros(256, np.uint8)
    table[:barred] = neutral + (np.arange(barred) * factor >> 8)
    table[NO_INFORMATION] = unknown
    out[1:-1, 1:-1] = table[costs]


@plainly(_weigh_numpy)
@vectorized
def _weigh(costs: Costs, neutral: int, factor: int, barred: int, unknown: int, out: NDArray[np.uint8]) -> None:
    """Weights of a costmap's cells, into the inner part of `out`; 0 from the cost `barred` on."""
    rows, columns = costs.shape
    base, slope, first = np.uint16(neutral), np.uint16(factor), np.uint16(barred)
    dark = np.uint8(unknown)
    for y in range(rows):
        given, made = costs[y], out[y + 1, 1 : columns + 1]
        for x in range(columns):
            cost = np.uint16(given[x])
            weight = np.uint8(base + np.uint16(np.uint16(cost * slope) >> np.uint16(8)))
            weight = weight if cost < first else np.uint8(0)
            made[x] = dark if cost == NO_INFORMATION else weight


class Field:
    """Weights of a grid's cells, and the memory of searches on it. Keep it: making it costs as much as a search."""

    def __init__(self, rows: int, columns: int) -> None:
        prepare(PLANNING)
        self.shape = rows, columns
        self.steps = Steps(*OCTILE_STEPS, 1)
        self._weights = np.zeros((rows + 2, columns + 2), np.uint8)
        self._costs = np.full((rows + 2) * (columns + 2), UNREACHED, np.uint32)
        self._box = np.zeros(4, np.int64)
        self._way = np.empty(_ROOM, np.int64)

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
        _weigh(costs, neutral, int(factor * 256.0), barred, heaviest if allow_unknown else 0, self._weights)
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
        try:
            if not search(self._weights.reshape(-1), stride, begin, end, self.steps, _SHIFT, self._costs, self._box):
                # All that can be reached has been.
                end = self._nearest(self._costs.reshape(-1, stride), UNREACHED, goal, tolerance)
            return None if end is None else self._trace(begin, end)
        finally:
            low, high, left, right = self._box.tolist()
            self._costs.reshape(-1, stride)[max(0, low) : high + 1, max(0, left) : right + 1] = UNREACHED

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

    def _trace(self, begin: int, end: int) -> Cells:
        stride = self.shape[1] + 2
        arguments = self._weights.reshape(-1), stride, begin, end, self.steps, self._costs
        while not (count := trace(*arguments, self._way)):
            self._way = np.empty(4 * len(self._way), np.int64)
        y, x = np.divmod(self._way[:count][::-1], stride)
        return np.stack((x - 1, y - 1), axis=1)

    def shorten(self, way: Cells) -> Cells:
        """The corners of a way of straight lines (n, 2) that costs no more than a way from cell to cell."""
        if len(way) < 3:
            return way
        return make_any_angle(self._weights.reshape(-1), self.shape[1] + 2, way + 1, self.steps.least) - 1

    def cost_of(self, corners: Cells) -> float:
        """Cost of the straight lines between these cells (n, 2): weight times cells; inf where they are blocked."""
        if len(corners) < 2:
            return 0.0
        out: Floats = np.empty(len(corners) - 1)
        points = np.ascontiguousarray(corners + 1)
        measure_lines(self._weights.reshape(-1), self.shape[1] + 2, points[:-1], points[1:], out)
        return float(out.sum())


def length_of(corners: Cells) -> float:
    """Length of the straight lines between cells, in cells."""
    return float(np.hypot(*np.diff(corners, axis=0).T).sum())
