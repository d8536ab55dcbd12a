"""The localiser against plain definitions, and compiled kernels against plain ones."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from support.examples import examples
from support.planning_cases import RESOLUTION, both_ways, random_cells, seeds
from zteam.compiling.takeover import prepare
from zteam.geometry import Pose2
from zteam.planning.amcl import Amcl
from zteam.planning.amcl_options import AmclOptions
from zteam.planning.clusters import estimate_pose
from zteam.planning.grid import make_map
from zteam.planning.jit import PLANNING
from zteam.planning.likelihood import make_likelihood_field, weigh_poses
from zteam.planning.matching import climb
from zteam.planning.particles import BIN_SIZE, kld_limits, resample
from zteam.planning.scans import Scan, Teammate
from zteam.planning.sines import cosine_sine


@pytest.fixture(autouse=True, scope="module")
def _compiled() -> None:
    prepare(PLANNING)


@given(st.one_of(st.floats(-7, 7), st.floats(-1e4, 1e4)))
def test_sines_are_those_of_the_c_library(angle: float) -> None:
    """Up to rounding; the same bits from numpy and from compiled code."""
    cos, sin = cosine_sine(angle)
    assert (cos, sin) == pytest.approx((math.cos(angle), math.sin(angle)), abs=1e-15 + 2e-16 * abs(angle))
    many = np.array([angle, -angle])
    assert [part[0] for part in cosine_sine.plain(many)] == [cos, sin]  # type: ignore[attr-defined]


@examples(30)
@given(seeds, st.integers(1, 40), st.integers(0, 30))
def test_weights_are_those_of_the_formula(seed: int, count: int, beams: int) -> None:
    """1 plus the sum of (z_hit exp(-d²/2σ²) + z_rand/range_max)³, d by looking at all cells; compiled and plain.

    Up to half a unit of the field a beam. A beam that ends a thousandth of a cell from another cell may count there.
    """
    rng = np.random.default_rng(seed)
    cells = np.where(random_cells(seed, 0.1, 30), 100, 0).astype(np.int8)
    origin = Pose2(*rng.uniform(-3, 3, 3).tolist())
    grid = make_map(cells, RESOLUTION, origin)
    field = make_likelihood_field(grid, z_hit=0.5, z_rand=0.5, sigma_hit=0.2, max_dist=1.0, range_max=10.0)
    local = np.column_stack((rng.uniform(-0.3, 3.3, (count, 2)), rng.uniform(-4, 4, count)))
    poses = np.array([origin.compose(Pose2(*pose)) for pose in local.tolist()])
    u, v = rng.uniform(-20, 20, (2, beams))
    (first,), (second,) = both_ways(lambda out: weigh_poses(field, poses, (u, v), out), np.ones(count))
    assert first.tobytes() == second.tobytes()
    lethal = np.argwhere(cells == 100)
    likelihoods = np.full((cells.shape[0] + 2, cells.shape[1] + 2), (0.5 * math.exp(-1.0 / 0.08) + 0.05) ** 3)
    for row, column in np.ndindex(cells.shape):
        square = min(((lethal - (row, column)) ** 2).sum(axis=1), default=10**9)
        d = min(1.0, math.sqrt(square) * RESOLUTION)
        likelihoods[row + 1, column + 1] = (0.5 * math.exp(-d * d / 0.08) + 0.05) ** 3
    for (x, y, yaw), weight in zip(local.tolist(), first.tolist(), strict=True):
        ends = np.array((x, y)) / RESOLUTION + np.column_stack(
            (math.cos(yaw) * u - math.sin(yaw) * v, math.sin(yaw) * u + math.cos(yaw) * v)
        )
        near = np.floor(ends + 1e-3 * np.array([(-1, -1), (-1, 1), (1, -1), (1, 1)])[:, None]).astype(int) + 1
        columns, rows = (np.clip(near[..., i], 0, likelihoods.shape[1 - i] - 1) for i in (0, 1))
        said = likelihoods[rows, columns]
        rounding = 0.5 * beams * field.unit + 1e-9
        assert 1.0 + said.min(axis=0).sum() - rounding <= weight <= 1.0 + said.max(axis=0).sum() + rounding


@examples(30)
@given(seeds)
def test_a_match_is_never_worse_and_the_same_both_ways(seed: int) -> None:
    """Poses climb; compiled and plain give the same bits."""
    rng = np.random.default_rng(seed)
    values = rng.integers(0, 65_536, (20, 22)).astype(np.uint16)
    beams = rng.uniform(-8, 8, 12), rng.uniform(-8, 8, 12)
    poses = np.column_stack((rng.uniform(3, 17, (6, 2)), rng.uniform(-3, 3, 6)))
    (first, sums), (second, others) = both_ways(
        lambda places, out: climb(values, places, beams, (2.0, 0.1), out), poses, np.zeros(6, np.int64)
    )
    assert first.tobytes() == second.tobytes()
    assert sums.tobytes() == others.tobytes()
    for (x, y, yaw), start, total in zip(first.tolist(), poses.tolist(), sums.tolist(), strict=True):
        assert total == sum_values(values, Pose2(x, y, yaw), beams)
        assert total >= sum_values(values, Pose2(*start), beams)


def sum_values(values: np.ndarray, pose: Pose2, beams: tuple[np.ndarray, np.ndarray]) -> int:
    """Values of the cells in which beams end, one after the other."""
    rows, columns = values.shape
    total = 0
    for u, v in zip(*beams, strict=True):
        end = pose.compose(Pose2(float(u), float(v), 0.0))
        total += int(values[min(max(math.floor(end.y), 0), rows - 1), min(max(math.floor(end.x), 0), columns - 1)])
    return total


@examples(30)
@given(seeds, st.integers(1, 60), st.integers(1, 80), st.floats(0.0, 0.5))
def test_particles_are_drawn_by_their_weights(seed: int, count: int, most: int, share: float) -> None:
    """Each draw gives the first particle whose running sum is above it, until KLD's limit; compiled and plain."""
    rng = np.random.default_rng(seed)
    poses, strangers = rng.normal(0.0, 2.0, (count, 3)), rng.normal(0.0, 5.0, (most, 3))
    weights = rng.random(count) * (rng.random(count) < 0.5) + 1e-9
    sums = np.cumsum(weights) / weights.sum()
    draws, mixing = rng.random(most), rng.random(most)
    draws[: most // 3] = rng.choice(np.minimum(sums, np.nextafter(1.0, 0.0)), most // 3)
    limits = kld_limits(5, most, 0.05, 0.99) if most > 5 else kld_limits(1, most, 0.05, 0.99)
    counts: list[int] = []

    def draw(out: np.ndarray) -> None:
        counts.append(resample(poses, sums, draws, strangers, mixing, share, limits, BIN_SIZE, out))

    (first,), (second,) = both_ways(draw, np.zeros((most, 3)))
    assert counts[0] == counts[1]
    drawn = first[: counts[0]]
    assert drawn.tobytes() == second[: counts[0]].tobytes()
    bins = set()
    for number, pose in enumerate(drawn):
        chosen = next((i for i in range(count) if sums[i] > draws[number]), count - 1)
        assert pose.tolist() == (strangers[number] if mixing[number] < share else poses[chosen]).tolist()
        bins.add((pose[0] // 0.5, pose[1] // 0.5, pose[2] % (2.0 * math.pi) // BIN_SIZE[2]))
        assert (number + 1 >= limits[len(bins)]) == (number + 1 == counts[0] and counts[0] < most) or number + 1 == most


@examples(30)
@given(seeds, st.integers(1, 60))
def test_the_estimate_is_the_same_both_ways(seed: int, count: int) -> None:
    """Bit for bit. One cluster's mean and covariance are numpy's, wherever its headings lie."""
    rng = np.random.default_rng(seed)
    for spread in (0.1, 4.0):
        poses = rng.uniform(-9.0, 9.0, 3) + rng.normal(0.0, spread, (count, 3)) * (1.0, 1.0, 0.3)
        weights = rng.random(count) + 0.01
        PLANNING.use_compiled()
        pose, covariance = estimate_pose(poses, weights)
        PLANNING.use_plain()
        other, same = estimate_pose(poses, weights)
        PLANNING.use_compiled()
        assert tuple(pose) == tuple(other)
        assert covariance.tobytes() == same.tobytes()
        if spread < 1.0:
            assert pose[:2] == pytest.approx(np.average(poses[:, :2], axis=0, weights=weights))
            assert math.remainder(pose.yaw - np.average(poses[:, 2], weights=weights), math.tau) == pytest.approx(0.0)
            expected = np.cov(poses.T, aweights=weights, ddof=0) if count > 1 else np.zeros((3, 3))
            assert covariance == pytest.approx(expected, abs=1e-12)


@examples(3)
@given(seeds)
def test_the_same_seed_gives_the_same_particles(seed: int) -> None:
    """Bit for bit, compiled and plain; another seed gives others."""
    rng = np.random.default_rng(seed)
    grid = make_map(np.where(random_cells(seed, 0.05, 60), 100, 0).astype(np.int8), RESOLUTION)
    scans = [
        Scan(rng.uniform(0.1, 6.0, 40).astype(np.float32), -2.0, 0.1, 0.0, 5.0, Pose2(0.1, 0.0, 0.0)) for _ in range(4)
    ]

    def run(number: int) -> bytes:
        options = AmclOptions(
            min_particles=20, max_particles=60, recovery_alpha_slow=0.001, recovery_alpha_fast=0.5, global_particles=50
        )
        localiser = Amcl(grid, options, seed=number)
        localiser.set_pose(Pose2(1.0, 1.0, 0.0))
        odom = Pose2(0.0, 0.0, 0.0)
        for scan in scans:
            odom = odom.compose(Pose2(0.3, 0.0, 0.1))
            assert localiser.update(odom, scan, [Teammate(1.0, 0.0, 0.3)])
        if (grid.cells == 0).any():
            localiser.localize_globally()
            localiser.update(odom, scans[0])
        return localiser.particles.tobytes() + repr(localiser.pose).encode()

    compiled = run(1)
    assert run(1) == compiled
    PLANNING.use_plain()
    assert run(1) == compiled
    PLANNING.use_compiled()
    assert run(2) != compiled
