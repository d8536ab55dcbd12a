"""How likely scans are: the likelihood field of a map (Thrun, Burgard, Fox 2005, section 6.4), as amcl uses it."""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from zteam.planning.costs import FREE_SPACE, LETHAL_OBSTACLE, Costs
from zteam.planning.grid import OCCUPIED, Frame, GridMap
from zteam.planning.inflation import MAX_CELLS, least_squares_numpy, measure_columns, widen
from zteam.planning.jit import compiled, plainly
from zteam.planning.sines import cosine_sine

Floats = NDArray[np.float64]
Values = NDArray[np.uint16]
Numbers = NDArray[np.floating[Any]]
Beams = tuple[Floats, Floats]
Place = tuple[float, float, float, float, float, float]


UNITS = 65_535
"""A field's largest value. Whole numbers add to the same sum in any order."""


class LikelihoodField(NamedTuple):
    """What a beam that ends in a cell adds to the weight of a pose."""

    frame: Frame
    values: NDArray[np.uint16]
    """(rows + 2, columns + 2): (z_hit · exp(−d² / 2σ²) + z_rand / range_max)³ in units of `unit`, d to the nearest
    occupied cell; around the map a border with the value of the largest distance."""
    unit: float


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
    unit = float(values.max()) / UNITS or 1.0
    return LikelihoodField(frame, np.rint(values / unit).astype(np.uint16)[squares], unit)


def beams_of(frame: Frame, ends: Floats) -> Beams:
    """The ends of beams (n, 2; metres in the base frame) in cells: along x and along y, (n) each."""
    cells = np.ascontiguousarray(ends.T) / frame.resolution
    return cells[0], cells[1]


def place_of(frame: Frame) -> Place:
    """Where a grid lies, as kernels take it: x, y, cosine, sine, yaw, and the size of a cell."""
    x, y, yaw = map(float, frame.origin)
    return x, y, math.cos(yaw), math.sin(yaw), yaw, frame.resolution


def sum_numpy(values: Values, cos: Numbers, sin: Numbers, x: Numbers, y: Numbers, beams: Beams) -> NDArray[np.int64]:
    """Sums of the field's values where the beams of poses end, one beam after the other; all in cells, of one shape."""
    rows, columns = values.shape
    sums = np.zeros(x.shape, np.int64)
    for u, v in zip(beams[0].tolist(), beams[1].tolist(), strict=True):
        column = np.minimum(np.maximum(x + (cos * u - sin * v), 0.0), columns - 1.0)
        row = np.minimum(np.maximum(y + (sin * u + cos * v), 0.0), rows - 1.0)
        sums += values[row.astype(np.int64), column.astype(np.int64)]
    return sums


def _weigh_numpy(values: Values, unit: float, place: Place, poses: Floats, beams: Beams, weights: Floats) -> None:
    """The same without numba."""
    east, north, cos0, sin0, yaw0, size = place
    dx, dy = poses[:, 0] - east, poses[:, 1] - north
    x, y = (cos0 * dx + sin0 * dy) / size + 1.0, (cos0 * dy - sin0 * dx) / size + 1.0
    cos, sin = cosine_sine(poses[:, 2] - yaw0)
    cos, sin, x, y = np.stack((cos, sin, x, y)).astype(np.float32)
    weights *= 1.0 + sum_numpy(values, cos, sin, x, y, beams) * unit


@plainly(_weigh_numpy)
@compiled
def _weigh(values: Values, unit: float, place: Place, poses: Floats, beams: Beams, weights: Floats) -> None:
    """See `weigh_poses`. `place` is that of the map; a field has a border of one cell.

    One beam of all poses after the other: where they end lies together in memory. Seven digits are a thousandth of a
    cell on a map of 10 000 cells.
    """
    east, north, cos0, sin0, yaw0, size = place
    rows, columns = values.shape
    flat = values.reshape(-1)
    zero, last_u, last_v, width = np.float32(0.0), np.float32(columns - 1.0), np.float32(rows - 1.0), np.int32(columns)
    count = poses.shape[0]
    cos, sin, x, y = np.empty((4, count), np.float32)
    for i in range(count):
        cos[i], sin[i] = cosine_sine(poses[i, 2] - yaw0)
    for i in range(count):
        dx, dy = poses[i, 0] - east, poses[i, 1] - north
        x[i], y[i] = (cos0 * dx + sin0 * dy) / size + 1.0, (cos0 * dy - sin0 * dx) / size + 1.0
    cells, sums = np.empty(count, np.int32), np.zeros(count, np.int32)
    for b in range(beams[0].shape[0]):
        beam_u, beam_v = np.float32(beams[0][b]), np.float32(beams[1][b])
        for i in range(count):
            u = x[i] + (cos[i] * beam_u - sin[i] * beam_v)
            v = y[i] + (sin[i] * beam_u + cos[i] * beam_v)
            u = u if u > zero else zero
            v = v if v > zero else zero
            u = u if u < last_u else last_u
            v = v if v < last_v else last_v
            cells[i] = np.int32(v) * width + np.int32(u)
        for i in range(count):
            sums[i] += flat[np.uint32(cells[i])]
    for i in range(count):
        weights[i] *= 1.0 + sums[i] * unit


def weigh_poses(field: LikelihoodField, poses: Floats, beams: Beams, weights: Floats) -> None:
    """Multiply the weight of each pose (n, 3; base in `map`) by 1 plus the sum of likelihoods where the beams end."""
    _weigh(field.values, field.unit, place_of(field.frame), poses, beams, weights)
