"""Poses near given ones at which a scan fits a map best."""

import math

import numpy as np
from numpy.typing import NDArray

from zteam.planning.grid import Frame
from zteam.planning.jit import compiled, plainly
from zteam.planning.likelihood import LikelihoodField

Floats = NDArray[np.float64]

_HALVINGS = 4
"""Times that steps are halved, and ..."""
_MOST_STEPS = 30
"""... how many are made at most."""
_SIDES = (-1.0, 0.0, 1.0)


def _sum_numpy(values: NDArray[np.float32], poses: Floats, beam_u: Floats, beam_v: Floats) -> Floats:
    """`_sum` of many poses, (n, 3) to (n)."""
    rows, columns = values.shape
    # numpy's own sine and cosine of arrays may differ from the C library's in the last digit.
    cos, sin = (np.array([f(yaw) for yaw in poses[:, 2].tolist()]) for f in (math.cos, math.sin))
    sums = np.zeros(len(poses))
    for u, v in zip(beam_u.tolist(), beam_v.tolist(), strict=True):
        column = np.minimum(np.maximum(poses[:, 0] + (cos * u - sin * v), 0.0), columns - 1.0)
        row = np.minimum(np.maximum(poses[:, 1] + (sin * u + cos * v), 0.0), rows - 1.0)
        sums += values[row.astype(np.int64), column.astype(np.int64)]
    return sums


def _climb_numpy(
    values: NDArray[np.float32], poses: Floats, beam_u: Floats, beam_v: Floats, steps: tuple[float, float],
    sums: Floats,
) -> None:  # fmt: skip
    """The same without numba: all poses at once."""
    around = np.array([(x, y, turn) for x in _SIDES for y in _SIDES for turn in _SIDES])
    sums[:] = _sum_numpy(values, poses, beam_u, beam_v)
    size = np.tile(np.array((steps[0], steps[0], steps[1])), (len(poses), 1))
    halvings = np.zeros(len(poses), np.int64)
    going = np.arange(len(poses))
    for _ in range(_MOST_STEPS):
        near = poses[going, None] + around * size[going, None]
        found = _sum_numpy(values, near.reshape(-1, 3), beam_u, beam_v).reshape(len(going), -1)
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
def _sum(values: NDArray[np.float32], x: float, y: float, yaw: float, beam_u: Floats, beam_v: Floats) -> float:
    """Sum of the field's values where the beams of one pose end."""
    rows, columns = values.shape
    cos, sin = math.cos(yaw), math.sin(yaw)
    total = 0.0
    for b in range(beam_u.shape[0]):
        column = min(max(x + (cos * beam_u[b] - sin * beam_v[b]), 0.0), columns - 1.0)
        row = min(max(y + (sin * beam_u[b] + cos * beam_v[b]), 0.0), rows - 1.0)
        total += values[np.int64(row), np.int64(column)]
    return total


@plainly(_climb_numpy)
@compiled
def climb(
    values: NDArray[np.float32], poses: Floats, beam_u: Floats, beam_v: Floats, steps: tuple[float, float],
    sums: Floats,
) -> None:  # fmt: skip
    """Move each of `poses` (n, 3) to a place near by where the beams are likeliest: a pattern search.

    All is in cells of `values`, as in `weigh_poses`. It looks at the 26 neighbours at a distance of `steps` (cells,
    radians), goes to the best one, and halves the steps where none is better. `sums` become the sums of likelihoods.
    """
    for i in range(poses.shape[0]):
        step, turn = steps
        best = _sum(values, poses[i, 0], poses[i, 1], poses[i, 2], beam_u, beam_v)
        halvings = 0
        for _ in range(_MOST_STEPS):
            x, y, yaw = poses[i, 0], poses[i, 1], poses[i, 2]
            found = False
            for dx in range(-1, 2):
                for dy in range(-1, 2):
                    for da in range(-1, 2):
                        u, v, a = x + dx * step, y + dy * step, yaw + da * turn
                        here = _sum(values, u, v, a, beam_u, beam_v)
                        if here > best:
                            best, found = here, True
                            poses[i, 0], poses[i, 1], poses[i, 2] = u, v, a
            if not found:
                halvings += 1
                step *= 0.5
                turn *= 0.5
                if halvings > _HALVINGS:
                    break
        sums[i] = best


def to_field(frame: Frame, poses: Floats) -> Floats:
    """Poses (n, 3) in `map` as cells of a likelihood field, which has a border of one cell."""
    found = np.empty((len(poses), 3))
    found[:, :2] = frame.points_to_cells(poses) + 1.0
    found[:, 2] = poses[:, 2] - frame.origin.yaw
    return found


def beams_of(frame: Frame, ends: Floats) -> tuple[Floats, Floats]:
    """The ends of beams (n, 2; metres in the base frame) in cells."""
    cells = ends / frame.resolution
    return np.ascontiguousarray(cells[:, 0]), np.ascontiguousarray(cells[:, 1])


def match(field: LikelihoodField, poses: Floats, ends: Floats, step: float, turn: float) -> tuple[Floats, Floats]:
    """The poses (n, 3) near `poses` (base in `map`) at which beams that end at `ends` (m, 2; base frame) fit best.

    And the mean of their likelihoods, (n). `step` (m) and `turn` (radians) are the first steps of the search.
    """
    frame = field.frame
    found, sums = to_field(frame, poses), np.zeros(len(poses))
    if not len(ends):
        return poses.copy(), sums
    climb(field.values, found, *beams_of(frame, ends), (step / frame.resolution, turn), sums)
    found[:, :2] = frame.points_from_cells(found[:, :2] - 1.0)
    found[:, 2] += frame.origin.yaw
    return found, sums / len(ends)
