"""Counter-based random numbers."""

from itertools import pairwise

import numpy as np

from support.flat_floor import make_view
from zteam.counter_random import gaussians, mix64, stream, uniform, uniforms


def test_the_finaliser_is_splitmix64s() -> None:
    """From state 0 it gives SplitMix64's first three published outputs."""
    golden = 0x9E3779B97F4A7C15
    assert [mix64(golden * n) for n in (1, 2, 3)] == [0xE220A8397B1DCDAF, 0x6E789E6AA1B965F4, 0x06C45D188009454F]


def test_numbers_depend_on_every_counter_and_their_order() -> None:
    """Changing or swapping counters changes the number; equal counters repeat it."""
    draws = [uniform(*c) for c in ((1, 2, 3, 4), (0, 2, 3, 4), (1, 0, 3, 4), (1, 2, 0, 4), (1, 2, 3, 0), (4, 3, 2, 1))]
    assert len(set(draws)) == len(draws)
    assert uniform(1, 2, 3, 4) == draws[0]


def test_numbers_are_spread_evenly() -> None:
    """Over consecutive ticks each tenth of [0, 1) gets its share."""
    draws = [uniform(1, 0, tick, 0) for tick in range(10_000)]
    shares = [sum(int(10 * u) == tenth for u in draws) for tenth in range(10)]
    assert min(shares) > 900
    assert max(shares) < 1100


def test_neighbours_are_uncorrelated() -> None:
    """The numbers of consecutive ticks have no correlation."""
    draws = [uniform(1, 0, tick, 0) for tick in range(10_000)]
    mean = sum(draws) / len(draws)
    covariance = sum((a - mean) * (b - mean) for a, b in pairwise(draws)) / len(draws)
    assert abs(covariance) < 0.003  # 1/12 is perfect correlation


def test_a_view_draws_for_its_robot_and_time() -> None:
    """A view's numbers differ by robot, seed, time and draw; equal views give equal numbers."""
    view = make_view(robot_id=1, seed=7)
    others = (make_view(robot_id=2, seed=7), make_view(robot_id=1, seed=8), make_view(now=5, robot_id=1, seed=7))
    assert len({view.random(0), view.random(1), *(v.random(0) for v in others)}) == 5
    assert view.random(0) == make_view(robot_id=1, seed=7).random(0)


def test_array_draws_are_splitmix64_streams() -> None:
    """Each row has SplitMix64's outputs from its stream's state, also when streams are drawn together."""
    streams = np.array([0, stream(1, 2)], np.uint64)
    together = uniforms(streams, 3)
    golden = 0x9E3779B97F4A7C15
    assert together[0].tolist() == [(mix64(golden * n) >> 11) * 2.0**-53 for n in (1, 2, 3)]
    assert together[1].tolist() == uniforms(streams[1:], 3)[0].tolist()


def test_gaussians_are_standard_normal() -> None:
    """Mean, variance, kurtosis and tails match a normal distribution."""
    draws = gaussians(np.arange(40, dtype=np.uint64), 5000)
    assert abs(draws.mean()) < 0.01
    assert abs(draws.var() - 1.0) < 0.02
    assert abs((draws**4).mean() - 3.0) < 0.1
    assert abs((abs(draws) > 2.0).mean() - 0.0455) < 0.003


def test_pairs_are_standard_normal_and_independent() -> None:
    """Mean 0, variance 1, no correlation between the two numbers of a hash; the first are nearly `gaussians`."""
    from zteam.counter_random import gaussian_pairs

    state = np.array([stream(1, 2)], np.uint64)
    pairs = gaussian_pairs(state, 50_000)[0].reshape(2, -1)
    assert np.abs(pairs[0] - gaussians(state, 50_000)[0]).max() < 1e-3
    assert np.abs(pairs.mean(axis=1)).max() < 0.02
    assert np.abs(np.cov(pairs) - np.eye(2)).max() < 0.03
