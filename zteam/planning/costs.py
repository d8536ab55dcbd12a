"""What the cells of a costmap cost: the names and values of nav2_costmap_2d (cost_values.hpp)."""

import math

import numpy as np
from numpy.typing import NDArray

FREE_SPACE = 0
MAX_NON_OBSTACLE = 252
INSCRIBED_INFLATED_OBSTACLE = 253
"""A robot whose centre is here touches an obstacle, however it is turned."""
LETHAL_OBSTACLE = 254
NO_INFORMATION = 255

Costs = NDArray[np.uint8]
"""(rows, columns)."""


def inflated_cost(distance: float, inscribed_radius: float, cost_scaling_factor: float) -> int:
    """The cost of a cell whose centre is `distance` metres from that of the nearest lethal cell.

    InflationLayer::computeCost of Nav2: 252 · exp(−k (d − inscribed radius)), cut to a whole number.
    """
    if distance == 0.0:
        return LETHAL_OBSTACLE
    if distance <= inscribed_radius:
        return INSCRIBED_INFLATED_OBSTACLE
    return int(MAX_NON_OBSTACLE * math.exp(-cost_scaling_factor * (distance - inscribed_radius)))
