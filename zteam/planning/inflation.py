"""Costs around obstacles: a distance field up to a radius, and the cost of each distance.

Distances are exact, from centre to centre of cells (Nav2 spreads from cell to cell, which is off by a cell in places).
"""

import math

import numpy as np
from numpy.typing import NDArray

from zteam.planning.costs import (
    FREE_SPACE,
    INSCRIBED_INFLATED_OBSTACLE,
    inflated_cost,
)

MAX_CELLS = 180
"""Largest radius, as `zteam.kernels.binding.square_distances` has it."""


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


def threshold_of_unknown(inflate_unknown: bool) -> int:
    """The cost from which on a cell without information becomes known (`inflate_unknown` of Nav2)."""
    return FREE_SPACE + 1 if inflate_unknown else INSCRIBED_INFLATED_OBSTACLE
