"""What beams say of cells: free up to where they end, occupied there."""

import numpy as np
from numpy.typing import NDArray

from zteam.planning.costs import FREE_SPACE, LETHAL_OBSTACLE, Costs
from zteam.planning.jit import compiled, plainly

Cells = NDArray[np.int64]


def _trace_numpy(costs: Costs, x0: int, y0: int, ends: Cells, marks: Cells) -> None:
    """The same without numba: all beams at once."""
    rows, columns = costs.shape
    for x, y in (_along(x0, y0, ends), (marks[:, 0], marks[:, 1])):
        inside = (x >= 0) & (y >= 0) & (x < columns) & (y < rows)
        costs[y[inside], x[inside]] = LETHAL_OBSTACLE if x.ndim == 1 else FREE_SPACE


def _along(x0: int, y0: int, ends: Cells) -> tuple[Cells, Cells]:
    """Columns and rows (beams, steps) of the cells from the start to each end; a short beam repeats its last cell."""
    delta = ends - np.array([x0, y0])
    across, way = np.abs(delta), np.sign(delta)
    longest = across.max(axis=1, initial=0)[:, None]
    k = np.minimum(np.arange(max(1, int(longest.max(initial=0)) + 1)), longest)
    share = np.maximum(2 * longest, 1)
    x = x0 + way[:, :1] * ((2 * k * across[:, :1] + longest) // share)
    y = y0 + way[:, 1:] * ((2 * k * across[:, 1:] + longest) // share)
    return x, y


@plainly(_trace_numpy)
@compiled
def trace_beams(costs: Costs, x0: int, y0: int, ends: Cells, marks: Cells) -> None:
    """Clear the cells from the sensor's (column `x0`, row `y0`) to each of `ends` (n, 2), then mark `marks` (n, 2).

    Cells are (column, row); those outside of `costs` are left out. The cells of a beam are Bresenham's.
    """
    rows, columns = costs.shape
    for beam in range(ends.shape[0]):
        dx, dy = ends[beam, 0] - x0, ends[beam, 1] - y0
        across, along = abs(dx), abs(dy)
        way_x, way_y = (1 if dx > 0 else -1), (1 if dy > 0 else -1)
        longest = max(across, along)
        share = max(2 * longest, 1)
        sum_x, sum_y = longest, longest
        x, y = x0, y0
        for _ in range(longest + 1):
            if 0 <= x < columns and 0 <= y < rows:
                costs[y, x] = FREE_SPACE
            sum_x += 2 * across
            sum_y += 2 * along
            if sum_x >= share:
                sum_x -= share
                x += way_x
            if sum_y >= share:
                sum_y -= share
                y += way_y
    for i in range(marks.shape[0]):
        x, y = marks[i, 0], marks[i, 1]
        if 0 <= x < columns and 0 <= y < rows:
            costs[y, x] = LETHAL_OBSTACLE
