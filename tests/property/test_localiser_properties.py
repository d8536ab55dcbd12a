"""The localiser against plain definitions."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from support import planning_references
from support.examples import examples
from support.planning_cases import RESOLUTION, random_cells, seeds
from zteam.geometry import Pose2
from zteam.kernels.navigation import climb, find_cluster, move_poses, resample, sum_poses
from zteam.navigation.planning.amcl import BIN_SIZE, Amcl, AmclOptions, estimate_pose, kld_limits
from zteam.navigation.planning.grid import make_map
from zteam.navigation.planning.likelihood import make_likelihood_field, weigh_poses
from zteam.navigation.planning.scans import Scan, Teammate


@given(seeds, st.integers(0, 20), st.one_of(st.floats(-7, 7), st.floats(-1e4, 1e4)))
def test_poses_turn_drive_and_turn(seed: int, count: int, yaw: float) -> None:
    """As the C library's sines say, up to rounding; what is not finite becomes NaN and touches no other pose."""
    rng = np.random.default_rng(seed)
    poses, draws = rng.normal(0.0, 1.0, (2, count, 3))
    poses[:, 2] += yaw
    poses[::5, 2] = math.inf
    motion = rng.normal(0.0, 1.0, 6)
    bearing = poses[:, 2] + motion[0] - motion[3] * draws[:, 0]
    length = motion[1] - motion[4] * draws[:, 1]
    with np.errstate(invalid="ignore"):
        x, y = poses[:, 0] + length * np.cos(bearing), poses[:, 1] + length * np.sin(bearing)
    expected = np.column_stack((x, y, bearing + motion[2] - motion[5] * draws[:, 2]))
    move_poses(poses, motion.tolist(), draws)
    assert poses == pytest.approx(expected, abs=1e-11, nan_ok=True)


@examples(30)
@given(seeds, st.integers(1, 40), st.integers(0, 30))
def test_weights_are_those_of_the_formula(seed: int, count: int, beams: int) -> None:
    """1 plus the sum of (z_hit exp(-d²/2σ²) + z_rand/range_max)³, d by looking at all cells.

    Up to half a unit of the field a beam. A beam that ends a thousandth of a cell from another cell may count there.
    """
    rng = np.random.default_rng(seed)
    cells = np.where(random_cells(seed, 0.1, 30), 100, 0).astype(np.int8)
    origin = Pose2(*rng.uniform(-3, 3, 3).tolist())
    grid = make_map(cells, RESOLUTION, origin)
    field = make_likelihood_field(grid, z_hit=0.5, z_rand=0.5, sigma_hit=0.2, max_dist=1.0, range_max=10.0)
    local = np.column_stack((rng.uniform(-0.3, 3.3, (count, 2)), rng.uniform(-4, 4, count)))
    poses = np.array([origin.compose(Pose2(*pose)) for pose in local.tolist()])
    u, v = ends = rng.uniform(-20, 20, (2, beams)).astype(np.float32)
    weights = np.ones(count)
    weigh_poses(field, poses, ends, weights)
    lethal = np.argwhere(cells == 100)
    likelihoods = np.full((cells.shape[0] + 2, cells.shape[1] + 2), (0.5 * math.exp(-1.0 / 0.08) + 0.05) ** 3)
    for row, column in np.ndindex(cells.shape):
        square = min(((lethal - (row, column)) ** 2).sum(axis=1), default=10**9)
        d = min(1.0, math.sqrt(square) * RESOLUTION)
        likelihoods[row + 1, column + 1] = (0.5 * math.exp(-d * d / 0.08) + 0.05) ** 3
    for (x, y, yaw), weight in zip(local.tolist(), weights.tolist(), strict=True):
        ends = np.array((x, y)) / RESOLUTION + np.column_stack(
            (math.cos(yaw) * u - math.sin(yaw) * v, math.sin(yaw) * u + math.cos(yaw) * v)
        )
        near = np.floor(ends + 1e-3 * np.array([(-1, -1), (-1, 1), (1, -1), (1, 1)])[:, None]).astype(int) + 1
        columns, rows = (np.clip(near[..., i], 0, likelihoods.shape[1 - i] - 1) for i in (0, 1))
        said = likelihoods[rows, columns]
        rounding = 0.5 * beams * field.unit + 1e-9
        assert 1.0 + said.min(axis=0).sum() - rounding <= weight <= 1.0 + said.max(axis=0).sum() + rounding


PLACES = st.tuples(st.floats(-5, 5), st.floats(-5, 5), st.just(0.0), st.floats(0.05, 2.0))


@examples(30)
@given(seeds, PLACES, st.integers(0, 300))
def test_sums_are_those_of_one_beam_after_the_other(seed: int, place: tuple[float, ...], beams: int) -> None:
    """For poses on the map and beside it; those that are not finite have sums too."""
    rng = np.random.default_rng(seed)
    values = rng.integers(0, 65_536, (20, 22)).astype(np.uint16)
    ends = rng.uniform(-8, 8, (2, beams)).astype(np.float32)
    # Headings whose sines are exact: no digit of theirs decides in which cell a beam ends.
    poses = np.column_stack((rng.uniform(-9, 30, (300, 2)), np.zeros(300)))
    sums = sum_poses(values, place, poses, ends)
    for number in range(0, 300, 37):
        assert sums[number] == planning_references.sum_values(values, place, Pose2(*poses[number].tolist()), ends)
    lost = np.array([(math.nan, 0.0, 0.0), (0.0, math.inf, 0.0), (0.0, 0.0, math.inf), (1e300, -1e300, 1e300)])
    assert (sum_poses(values, place, lost, ends) <= 65_535 * beams).all()


@examples(20)
@given(seeds)
def test_a_match_is_where_a_pattern_search_ends(seed: int) -> None:
    """Poses climb as the reference does, and to no worse a place."""
    rng = np.random.default_rng(seed)
    # Smooth, so that the last digits of a place do not matter.
    u, v = np.meshgrid(np.arange(22.0), np.arange(20.0))
    values = (1000.0 * np.hypot(u - rng.uniform(3, 17), v - rng.uniform(3, 17))).astype(np.uint16)
    place, beams = (-1.0, 0.5, 0.3, 0.25), rng.uniform(-8, 8, (2, 12)).astype(np.float32)
    poses = np.column_stack((rng.uniform(0, 4, (4, 2)), rng.uniform(-3, 3, 4)))
    found = poses.copy()
    sums = climb(values, place, found, beams, (0.5, 0.1), 4, 30)
    assert sums.tolist() == sum_poses(values, place, found, beams).tolist()
    assert (sums >= sum_poses(values, place, poses, beams)).all()
    for start, end in zip(poses, found, strict=True):
        expected = planning_references.climb(values, place, start, beams, 0.5, 0.1, 4, 30)
        assert end == pytest.approx(expected, abs=1e-9)


@examples(30)
@given(seeds, st.integers(1, 60), st.integers(1, 80), st.floats(0.0, 0.5))
def test_particles_are_drawn_by_their_weights(seed: int, count: int, most: int, share: float) -> None:
    """Each draw gives the first particle whose running sum is above it, until KLD's limit."""
    rng = np.random.default_rng(seed)
    poses, strangers = rng.normal(0.0, 2.0, (count, 3)), rng.normal(0.0, 5.0, (most, 3))
    weights = rng.random(count) * (rng.random(count) < 0.5) + 1e-9
    sums = np.cumsum(weights) / weights.sum()
    draws, strange = rng.random(most), rng.random(most) < share
    draws[: most // 3] = rng.choice(np.minimum(sums, np.nextafter(1.0, 0.0)), most // 3)
    limits = kld_limits(5, most, 0.05, 0.99) if most > 5 else kld_limits(1, most, 0.05, 0.99)
    drawn = resample(np.concatenate((poses, strangers)), sums, draws, strange, limits, BIN_SIZE)
    bins = set()
    for number, pose in enumerate(drawn):
        chosen = next((i for i in range(count) if sums[i] > draws[number]), count - 1)
        assert pose.tolist() == (strangers[number] if strange[number] else poses[chosen]).tolist()
        bins.add((pose[0] // 0.5, pose[1] // 0.5, pose[2] % (2.0 * math.pi) // BIN_SIZE[2]))
        assert (number + 1 >= limits[len(bins)]) == (
            number + 1 == len(drawn) and len(drawn) < most
        ) or number + 1 == most


@examples(30)
@given(seeds, st.integers(1, 60), st.sampled_from([0.1, 2.0, 4.0]))
def test_particles_that_touch_are_a_cluster(seed: int, count: int, spread: float) -> None:
    """Labels are the reference's; one cluster's mean and covariance are numpy's, wherever its headings lie."""
    rng = np.random.default_rng(seed)
    poses = rng.uniform(-9.0, 9.0, 3) + rng.normal(0.0, spread, (count, 3)) * (1.0, 1.0, 0.3)
    weights = rng.random(count) + 0.01
    labels = find_cluster(poses, weights, BIN_SIZE, 36)[0]
    assert labels.tolist() == planning_references.label_clusters(poses, BIN_SIZE, 36)
    pose, covariance = estimate_pose(poses, weights)
    heaviest = labels == np.bincount(labels, weights).argmax()
    poses, weights = poses[heaviest], weights[heaviest]
    assert pose[:2] == pytest.approx(np.average(poses[:, :2], axis=0, weights=weights))
    if spread < 1.0:
        assert math.remainder(pose.yaw - np.average(poses[:, 2], weights=weights), math.tau) == pytest.approx(0.0)
        expected = np.cov(poses.T, aweights=weights, ddof=0) if len(poses) > 1 else np.zeros((3, 3))
        assert covariance == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("odd", [math.nan, math.inf, 1e300])
def test_particles_that_are_nowhere_are_drawn_and_labelled_too(odd: float) -> None:
    """What is not finite, or too far away for a bin, has a result: it is in one bin."""
    poses, sums = np.full((5, 3), odd), np.array((0.1, math.nan, 0.2, odd, 1.0))
    draws = np.array((odd, -odd, math.nan, 0.5, 2.0, -1.0))
    drawn = resample(poses, sums, draws, np.zeros(6, bool), np.array((6,)), BIN_SIZE)
    assert drawn.shape == (6, 3)
    assert find_cluster(poses, np.full(5, odd), BIN_SIZE, 36)[0].tolist() == [0] * 5


@examples(3)
@given(seeds)
def test_the_same_seed_gives_the_same_particles(seed: int) -> None:
    """Bit for bit; another seed gives others."""
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

    first = run(1)
    assert run(1) == first
    assert run(2) != first
