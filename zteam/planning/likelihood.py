"""How likely scans are: the likelihood field of a map (Thrun, Burgard, Fox 2005, section 6.4), as amcl uses it."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from zteam.kernels.binding import BeamEnds, Floats, square_distances, sum_poses
from zteam.planning.costs import FREE_SPACE, LETHAL_OBSTACLE
from zteam.planning.grid import OCCUPIED, Frame, GridMap
from zteam.planning.inflation import MAX_CELLS

UNITS = 65_535
"""A field's largest value. Whole numbers add to the same sum in any order."""


class LikelihoodField(NamedTuple):
    """What a beam that ends in a cell adds to the weight of a pose."""

    frame: Frame
    values: NDArray[np.uint16]
    """(rows + 2, columns + 2): (z_hit · exp(−d² / 2σ²) + z_rand / range_max)³ in units of `unit`, d to the nearest
    occupied cell; around the map a border with the value of the largest distance."""
    unit: float

    @property
    def place(self) -> tuple[float, float, float, float]:
        """x, y (metres) and yaw of the map's lower left corner in `map`, and metres a cell."""
        return *self.frame.origin, self.frame.resolution


def make_likelihood_field(
    grid: GridMap, *, z_hit: float, z_rand: float, sigma_hit: float, max_dist: float, range_max: float
) -> LikelihoodField:
    """The field of a map. `max_dist` (m): no distance counts as more than this (`laser_likelihood_max_dist`)."""
    frame = grid.frame
    reach = min(MAX_CELLS - 1, math.ceil(max_dist / frame.resolution))
    costs = np.where(grid.cells >= OCCUPIED, LETHAL_OBSTACLE, FREE_SPACE).astype(np.uint8)
    squares = np.full((frame.rows + 2, frame.columns + 2), (reach + 1) ** 2, np.uint16)
    squares[1:-1, 1:-1] = square_distances(costs, (0, frame.rows, 0, frame.columns), reach)
    distances = np.minimum(np.sqrt(np.arange((reach + 1) ** 2 + 1)) * frame.resolution, max_dist)
    values = (z_hit * np.exp(-(distances**2) / (2.0 * sigma_hit**2)) + z_rand / range_max) ** 3
    unit = float(values.max()) / UNITS or 1.0
    return LikelihoodField(frame, np.rint(values / unit).astype(np.uint16)[squares], unit)


def beams_of(frame: Frame, ends: Floats) -> BeamEnds:
    """The ends of beams (n, 2; metres in the base frame) in cells: (2, n)."""
    return np.ascontiguousarray(ends.T / frame.resolution, np.float32)


def weigh_poses(field: LikelihoodField, poses: Floats, beams: BeamEnds, weights: Floats) -> None:
    """Multiply the weight of each pose (n, 3; base in `map`) by 1 plus the sum of likelihoods where the beams end."""
    weights *= 1.0 + sum_poses(field.values, field.place, poses, beams) * field.unit
