"""Costs around obstacles: a distance field up to a radius, and the cost of each distance.

Distances are exact, from centre to centre of cells (Nav2 spreads from cell to cell, which is off by a cell in places).
Two passes along the columns give the distance to the nearest obstacle of the column; a third one takes, along the row,
the least of its square and that of the way there (Felzenszwalb and Huttenlocher 2012, by brute force within the radius:
on bytes and 16 bits that is vector code, and faster than their parabolas).
"""

import math

import numpy as np
from numpy.typing import NDArray

from zteam.planning.costs import (
    FREE_SPACE,
    INSCRIBED_INFLATED_OBSTACLE,
    LETHAL_OBSTACLE,
    NO_INFORMATION,
    Costs,
    inflated_cost,
)
from zteam.planning.jit import compiled, plainly, vectorized

MAX_CELLS = 180
"""Largest radius: the sum of two squares of it fits into 16 bits."""

Window = tuple[int, int, int, int]
"""Rows from, to (not included), columns from, to."""


def radius_in_cells(radius: float, resolution: float) -> int:
    """Cells that a radius (m) reaches: Costmap2D::cellDistance of Nav2. Raises ValueError above MAX_CELLS."""
    cells = max(0, math.ceil(radius / resolution))
    if cells > MAX_CELLS:
        raise ValueError(f"inflation_radius {radius:g} is {cells} cells of {resolution:g} m: at most {MAX_CELLS}")
    return cells


def cost_table(
    radius: float, inscribed_radius: float, cost_scaling_factor: float, resolution: float
) -> NDArray[np.uint8]:
    """The cost by squared distance in cells, up to that of one cell beyond `radius` (m), where it is FREE_SPACE."""
    reach = radius_in_cells(radius, resolution)
    table = np.full((reach + 1) ** 2 + 1, FREE_SPACE, np.uint8)
    for square in range(reach * reach + 1):
        table[square] = inflated_cost(math.sqrt(square) * resolution, inscribed_radius, cost_scaling_factor)
    return table


@vectorized
def measure_columns(costs: Costs, r0: int, c0: int, far: int, out: NDArray[np.uint8]) -> None:
    """Distance to the nearest lethal cell of the same column in cells, at most `far`; `out` begins at (r0, c0)."""
    rows, columns = out.shape
    cap = np.uint8(far)
    for x in range(columns):
        out[0, x] = np.uint8(0) if costs[r0, c0 + x] == LETHAL_OBSTACLE else cap
    for y in range(1, rows):
        for x in range(columns):
            above = out[y - 1, x]
            further = np.uint8(above + np.uint8(1)) if above < cap else cap
            out[y, x] = np.uint8(0) if costs[r0 + y, c0 + x] == LETHAL_OBSTACLE else further
    for y in range(rows - 2, -1, -1):
        for x in range(columns):
            below = out[y + 1, x]
            further = np.uint8(below + np.uint8(1)) if below < cap else cap
            here = out[y, x]
            out[y, x] = further if further < here else here


@vectorized
def widen(squares: NDArray[np.uint16], reach: int, least: NDArray[np.uint16]) -> None:
    """Least of each square and those up to `reach` columns away, plus the square of the way."""
    count = least.shape[0]
    middle = squares[reach : reach + count]
    for x in range(count):
        least[x] = middle[x]
    for k in range(1, reach + 1):
        way = np.uint16(k * k)
        left, right = squares[reach - k : reach - k + count], squares[reach + k : reach + k + count]
        for x in range(count):
            one, other, here = np.uint16(left[x] + way), np.uint16(right[x] + way), least[x]
            one = one if one < other else other
            least[x] = one if one < here else here


def _inflate_numpy(
    costs: Costs, table: NDArray[np.uint8], reach: int, window: Window, unknown_from: int, out: Costs
) -> None:
    """The same without numba: each pass as whole arrays."""
    r0, r1, c0, c1 = window
    low, high = max(0, r0 - reach), min(costs.shape[0], r1 + reach)
    left, right = max(0, c0 - reach), min(costs.shape[1], c1 + reach)
    part = costs[low:high, left:right] == LETHAL_OBSTACLE
    far = (reach + 1) ** 2
    column = least_squares_numpy(np.where(part, 0, far).astype(np.int32), reach)
    squares = least_squares_numpy(np.ascontiguousarray(column.T), reach).T
    near = squares[r0 - low : r1 - low, c0 - left : c1 - left]
    cost = table[np.minimum(near, far)]
    here = costs[r0:r1, c0:c1]
    raised = np.where(here == NO_INFORMATION, np.where(cost >= unknown_from, cost, here), np.maximum(here, cost))
    out[r0:r1, c0:c1] = raised


def least_squares_numpy(squares: NDArray[np.int32], reach: int) -> NDArray[np.int32]:
    """Least of each value and those up to `reach` rows away, plus the square of the way."""
    least = squares.copy()
    for k in range(1, reach + 1):
        np.minimum(least[k:], squares[:-k] + k * k, out=least[k:])
        np.minimum(least[:-k], squares[k:] + k * k, out=least[:-k])
    return least


@plainly(_inflate_numpy)
@compiled
def inflate(costs: Costs, table: NDArray[np.uint8], reach: int, window: Window, unknown_from: int, out: Costs) -> None:
    """Raise the cells in `window` of `costs` to the cost of their distance to a lethal cell, into `out`.

    Lethal cells up to `reach` cells outside of the window count. A cell without information gets a cost from
    `unknown_from` on; a lower one leaves it unknown.
    """
    r0, r1, c0, c1 = window
    low, high = max(0, r0 - reach), min(costs.shape[0], r1 + reach)
    left, right = max(0, c0 - reach), min(costs.shape[1], c1 + reach)
    columns = right - left
    steps = np.empty((high - low, columns), np.uint8)
    far = reach + 1
    measure_columns(costs, low, left, far, steps)
    squares = np.full(columns + 2 * reach, far * far, np.uint16)
    least = np.empty(columns, np.uint16)
    for y in range(r0, r1):
        for x in range(columns):
            step = np.uint16(steps[y - low, x])
            squares[reach + x] = np.uint16(step * step)
        widen(squares, reach, least)
        for x in range(c0, c1):
            square = least[x - left]
            cost = table[square] if square < far * far else np.uint8(FREE_SPACE)
            here = costs[y, x]
            if here == NO_INFORMATION:
                out[y, x] = cost if cost >= unknown_from else here
            else:
                out[y, x] = cost if cost > here else here


def threshold_of_unknown(inflate_unknown: bool) -> int:
    """The cost from which on a cell without information becomes known (`inflate_unknown` of Nav2)."""
    return FREE_SPACE + 1 if inflate_unknown else INSCRIBED_INFLATED_OBSTACLE
