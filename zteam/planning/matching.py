"""Poses near given ones at which a scan fits a map best."""

import numpy as np
from numpy.typing import NDArray

from zteam.planning.jit import compiled, plainly
from zteam.planning.likelihood import Beams, Floats, LikelihoodField, Values, sum_numpy
from zteam.planning.sines import cosine_sine

Sums = NDArray[np.int64]

_HALVINGS = 4
"""Times that steps are halved, and ..."""
_MOST_STEPS = 30
"""... how many are made at most."""
_SIDES = (-1.0, 0.0, 1.0)


def _climb_numpy(values: Values, poses: Floats, beams: Beams, steps: tuple[float, float], sums: Sums) -> None:
    """The same without numba: all poses at once."""
    around = np.array([(x, y, turn) for turn in _SIDES for x in _SIDES for y in _SIDES])

    def measure(places: Floats) -> Sums:
        return sum_numpy(values, *cosine_sine(places[..., 2]), places[..., 0], places[..., 1], beams)

    sums[:] = measure(poses)
    size = np.tile(np.array((steps[0], steps[0], steps[1])), (len(poses), 1))
    halvings = np.zeros(len(poses), np.int64)
    going = np.arange(len(poses))
    for _ in range(_MOST_STEPS):
        near = poses[going, None] + around * size[going, None]
        found = measure(near)
        best = found.argmax(axis=1)
        better = found[np.arange(len(going)), best] > sums[going]
        up = going[better]
        poses[up], sums[up] = near[better, best[better]], found[better, best[better]]
        stuck = going[~better]
        halvings[stuck] += 1
        size[stuck] *= 0.5
        going = going[better | (halvings[going] <= _HALVINGS)]
        if not len(going):
            return


@compiled
def _rotate(yaw: float, beams: Beams, turned: Floats) -> None:
    """The beams' ends as seen from a pose with this heading, into `turned` (2, n)."""
    cos, sin = cosine_sine(yaw)
    for b in range(beams[0].shape[0]):
        turned[0, b] = cos * beams[0][b] - sin * beams[1][b]
        turned[1, b] = sin * beams[0][b] + cos * beams[1][b]


@compiled
def _sum(values: Values, x: float, y: float, turned: Floats, cells: NDArray[np.int32]) -> int:
    """Sum of the field's values where the beams of one place end; `cells` (n) is room for their indexes."""
    rows, columns = values.shape
    flat = values.reshape(-1)
    last_u, last_v, width = columns - 1.0, rows - 1.0, np.int32(columns)
    for b in range(cells.shape[0]):
        u, v = x + turned[0, b], y + turned[1, b]
        u = u if u > 0.0 else 0.0
        v = v if v > 0.0 else 0.0
        u = u if u < last_u else last_u
        v = v if v < last_v else last_v
        cells[b] = np.int32(v) * width + np.int32(u)
    total = 0
    for b in range(cells.shape[0]):
        total += flat[np.uint32(cells[b])]
    return int(total)


@plainly(_climb_numpy)
@compiled
def climb(values: Values, poses: Floats, beams: Beams, steps: tuple[float, float], sums: Sums) -> None:
    """Move each of `poses` (n, 3) to a place near by where the beams are likeliest: a pattern search.

    All is in cells of `values`. It looks at the 26 neighbours at a distance of `steps` (cells, radians), goes to the
    best one, and halves the steps where none is better. `sums` become the sums of values.
    """
    count = beams[0].shape[0]
    turned, cells = np.empty((2, count)), np.empty(count, np.int32)
    for i in range(poses.shape[0]):
        step, turn = steps
        _rotate(poses[i, 2], beams, turned)
        best = _sum(values, poses[i, 0], poses[i, 1], turned, cells)
        halvings = 0
        for _ in range(_MOST_STEPS):
            x, y, yaw = poses[i, 0], poses[i, 1], poses[i, 2]
            found = False
            for da in range(-1, 2):
                angle = yaw + da * turn
                _rotate(angle, beams, turned)
                for dx in range(-1, 2):
                    for dy in range(-1, 2):
                        u, v = x + dx * step, y + dy * step
                        here = _sum(values, u, v, turned, cells)
                        if here > best:
                            best, found = here, True
                            poses[i, 0], poses[i, 1], poses[i, 2] = u, v, angle
            if not found:
                halvings += 1
                step *= 0.5
                turn *= 0.5
                if halvings > _HALVINGS:
                    break
        sums[i] = best


def match(field: LikelihoodField, poses: Floats, beams: Beams, step: float, turn: float) -> tuple[Floats, Floats]:
    """The poses (n, 3) near `poses` (base in `map`) at which the beams fit best.

    And the mean of their likelihoods, (n). `step` (m) and `turn` (radians) are the first steps of the search.
    """
    frame = field.frame
    if not len(beams[0]):
        return poses.copy(), np.zeros(len(poses))
    found, sums = np.empty((len(poses), 3)), np.zeros(len(poses), np.int64)
    # A field has a border of one cell.
    found[:, :2] = frame.points_to_cells(poses) + 1.0
    found[:, 2] = poses[:, 2] - frame.origin.yaw
    climb(field.values, found, beams, (step / frame.resolution, turn), sums)
    found[:, :2] = frame.points_from_cells(found[:, :2] - 1.0)
    found[:, 2] += frame.origin.yaw
    return found, sums.astype(np.float64) * (field.unit / len(beams[0]))
