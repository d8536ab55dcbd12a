"""The laser kernels against brute force, on random bitmaps and poses."""

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from support.examples import examples
from zteam.sim import numpy_kernels, square_kernels
from zteam.sim.fields import build_fields

LIMIT = 9.0

bitmaps = st.integers(0, 2**32 - 1).map(
    lambda seed: np.random.default_rng(seed).random((13, 17)) < np.random.default_rng(seed + 1).uniform(0.02, 0.3)
)
angles = st.one_of(
    st.floats(-math.pi, math.pi), st.sampled_from([i * math.pi / 4 for i in range(-4, 5)])
)  # axis-aligned and diagonal rays among them


def brute_force(occupied: np.ndarray, cell: tuple[float, float], x: float, y: float, angle: float) -> float:
    """Distance to the nearest occupied cell's box along the ray (slab test against each), LIMIT at most."""
    rows, columns = np.nonzero(occupied)
    dx, dy = math.cos(angle), math.sin(angle)
    dx, dy = (d if abs(d) > 1e-9 else math.copysign(1e-9, d) for d in (dx, dy))
    low_x, low_y = columns * cell[0] - x, rows * cell[1] - y
    tx, ty = np.stack((low_x / dx, (low_x + cell[0]) / dx)), np.stack((low_y / dy, (low_y + cell[1]) / dy))
    enter = np.maximum(tx.min(axis=0), ty.min(axis=0))
    leave = np.minimum(tx.max(axis=0), ty.max(axis=0))
    hits = enter[(enter < leave - 1e-9) & (leave > 0)]
    return min(LIMIT, max(0.0, float(hits.min()))) if hits.size else LIMIT


@given(bitmaps, st.floats(-1.0, 4.0), st.floats(-1.0, 4.0), angles, st.sampled_from([(0.2, 0.2), (0.15, 0.23)]))
@examples(300)
def test_rays_are_exact(occupied: np.ndarray, x: float, y: float, yaw: float, cell: tuple[float, float]) -> None:
    """Both kernels agree with the slab test against every cell, also for starts outside and unequal cells."""
    # Off the lattice: from a cell's very corner, which of two touching cells a ray meets is a matter of taste.
    x, y = x + 0.0123456789, y + 0.0234567891
    column, row = math.floor(x / cell[0]), math.floor(y / cell[1])
    inside = 0 <= row < 13 and 0 <= column < 17
    if inside and occupied[row, column]:
        return
    fields = build_fields(occupied)
    beams = np.array([0.0, 0.3, -1.1, math.pi / 2])
    place = np.array([x]), np.array([y]), np.array([yaw]), np.array([True])
    table = np.cos(beams)[None, :], np.sin(beams)[None, :]
    results = []
    for module in (square_kernels, numpy_kernels):
        out, hit = np.full((1, 4), LIMIT), np.zeros((1, 4), np.int32)
        module.cast_squares(fields.sides, fields.rows, fields.columns, *cell, *place, *table, LIMIT, 7, out, hit)
        assert ((hit == 7) == (out < LIMIT)).all()
        results.append(out[0])
    assert (results[0] == results[1]).all()
    for beam, ours in zip(beams, results[0], strict=True):
        expected = brute_force(occupied, cell, x, y, yaw + beam)
        # A ray through the corner of a cell may be said to touch it or not; a hair beside it decides the same way.
        near = [brute_force(occupied, cell, x, y, yaw + beam + turn) for turn in (-1e-7, 1e-7)]
        assert min(abs(ours - e) for e in (expected, *near)) <= 1e-5
