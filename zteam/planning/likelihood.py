"""How likely scans are: the likelihood field of a map (Thrun, Burgard, Fox 2005, section 6.4), as amcl uses it."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from zteam.planning.costs import FREE_SPACE, LETHAL_OBSTACLE, Costs
from zteam.planning.grid import OCCUPIED, Frame, GridMap
from zteam.planning.inflation import MAX_CELLS, least_squares_numpy, measure_columns, widen
from zteam.planning.jit import compiled, plainly

Floats = NDArray[np.float64]


class LikelihoodField(NamedTuple):
    """What a beam that ends in a cell adds to the weight of a pose."""

    frame: Frame
    values: NDArray[np.float32]
    """(rows + 2, columns + 2): (z_hit · exp(−d² / 2σ²) + z_rand / range_max)³, d to the nearest occupied cell; around
    the map a border with the value of the largest distance."""


def _square_distances_numpy(costs: Costs, reach: int, out: NDArray[np.uint16]) -> None:
    far = (reach + 1) ** 2
    column = least_squares_numpy(np.where(costs == LETHAL_OBSTACLE, 0, far).astype(np.int32), reach)
    out[:] = np.minimum(least_squares_numpy(np.ascontiguousarray(column.T), reach).T, far)


@plainly(_square_distances_numpy)
@compiled
def square_distances(costs: Costs, reach: int, out: NDArray[np.uint16]) -> None:
    """Squared distance of each cell to the nearest lethal one, in cells; at most (`reach` + 1)²."""
    rows, columns = costs.shape
    far = reach + 1
    steps = np.empty((rows, columns), np.uint8)
    measure_columns(costs, 0, 0, far, steps)
    squares = np.full(columns + 2 * reach, far * far, np.uint16)
    least = np.empty(columns, np.uint16)
    for y in range(rows):
        for x in range(columns):
            step = np.uint16(steps[y, x])
            squares[reach + x] = np.uint16(step * step)
        widen(squares, reach, least)
        for x in range(columns):
            out[y, x] = least[x] if least[x] < far * far else np.uint16(far * far)


def make_likelihood_field(
    grid: GridMap, *, z_hit: float, z_rand: float, sigma_hit: float, max_dist: float, range_max: float
) -> LikelihoodField:
    """The field of a map. `max_dist` (m): no distance counts as more than this (`laser_likelihood_max_dist`)."""
    frame = grid.frame
    reach = min(MAX_CELLS - 1, math.ceil(max_dist / frame.resolution))
    costs = np.where(grid.cells >= OCCUPIED, LETHAL_OBSTACLE, FREE_SPACE).astype(np.uint8)
    squares = np.full((frame.rows + 2, frame.columns + 2), (reach + 1) ** 2, np.uint16)
    inner = np.empty(costs.shape, np.uint16)
    square_distances(costs, reach, inner)
    squares[1:-1, 1:-1] = inner
    distances = np.minimum(np.sqrt(np.arange((reach + 1) ** 2 + 1)) * frame.resolution, max_dist)
    values = (z_hit * np.exp(-(distances**2) / (2.0 * sigma_hit**2)) + z_rand / range_max) ** 3
    return LikelihoodField(frame, values.astype(np.float32)[squares])


def _weigh_numpy(values: NDArray[np.float32], poses: Floats, beam_u: Floats, beam_v: Floats, weights: Floats) -> None:
    """The same without numba: one beam after the other, for all poses."""
    rows, columns = values.shape
    # numpy's own sine and cosine of arrays may differ from the C library's in the last digit.
    cos, sin = (np.array([f(yaw) for yaw in poses[:, 2].tolist()]) for f in (math.cos, math.sin))
    sums = np.ones(len(poses))
    for u, v in zip(beam_u.tolist(), beam_v.tolist(), strict=True):
        column = np.minimum(np.maximum(poses[:, 0] + (cos * u - sin * v), 0.0), columns - 1.0)
        row = np.minimum(np.maximum(poses[:, 1] + (sin * u + cos * v), 0.0), rows - 1.0)
        sums += values[row.astype(np.int64), column.astype(np.int64)]
    weights *= sums


@plainly(_weigh_numpy)
@compiled
def weigh_poses(values: NDArray[np.float32], poses: Floats, beam_u: Floats, beam_v: Floats, weights: Floats) -> None:
    """Multiply each weight by 1 plus the sum of the field's `values` where the beams end.

    `poses` (n, 3) are in cells of `values`, with the direction in the grid; the beams' ends are in cells too, in the
    base frame.
    """
    rows, columns = values.shape
    flat = values.reshape(-1)
    last_u, last_v = columns - 1.0, rows - 1.0
    beams = beam_u.shape[0]
    place = np.empty(beams, np.int32)
    for i in range(poses.shape[0]):
        x, y = poses[i, 0], poses[i, 1]
        cos, sin = math.cos(poses[i, 2]), math.sin(poses[i, 2])
        for b in range(beams):
            u = x + (cos * beam_u[b] - sin * beam_v[b])
            v = y + (sin * beam_u[b] + cos * beam_v[b])
            u = u if u > 0.0 else 0.0
            v = v if v > 0.0 else 0.0
            u = u if u < last_u else last_u
            v = v if v < last_v else last_v
            place[b] = np.int32(np.int32(v) * np.int32(columns) + np.int32(u))
        total = 1.0
        for b in range(beams):
            total += flat[np.uint32(place[b])]
        weights[i] *= total
