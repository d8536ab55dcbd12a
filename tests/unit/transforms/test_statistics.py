"""Figures of a stream of transforms."""

import tracemalloc

import pytest

from support.transforms import S, stamped
from zteam.transforms.statistics import WINDOW, TransformWatch


def test_a_watch_measures_rate_jitter_and_delay() -> None:
    """Stamps with gaps of 0.1, 0.1 and 0.4 s give 5 Hz, the jitter of the gaps, and delays by the team's clock."""
    watch = TransformWatch()
    for stamp, now in ((S, 0), (S + S // 10, S + S // 5), (S + S // 5, S + S // 5), (S + 3 * S // 5, S)):
        watch.take([stamped("odom", "base", stamp)], now)
    (figures,) = watch.figures()
    assert (figures.parent, figures.child, figures.count) == ("odom", "base", 4)
    assert figures.rate == pytest.approx(5.0)
    assert figures.jitter == pytest.approx(0.141421, abs=1e-5)
    assert figures.mean_delay == pytest.approx(0.1 / 3)
    assert figures.max_delay == pytest.approx(0.1)
    watch.take([stamped("odom", "other", S)], 0)
    lonely = watch.figures()[1]
    assert (lonely.rate, lonely.jitter, lonely.mean_delay) == (None, None, None)


def test_samples_in_any_order_give_the_same_figures() -> None:
    """The order of arrival does not change the figures."""
    watches = TransformWatch(), TransformWatch()
    stamps = [S + i * i * S // 100 for i in range(20)]
    for watch, order in zip(watches, (stamps, sorted(stamps, key=lambda stamp: stamp % 7)), strict=True):
        for stamp in order:
            watch.take([stamped("odom", "base", stamp)], 30 * S)
    one, other = (watch.figures()[0] for watch in watches)
    assert (one.count, one.rate, one.jitter, one.max_delay) == (other.count, other.rate, other.jitter, other.max_delay)
    assert one.mean_delay == pytest.approx(other.mean_delay)


def test_the_memory_of_a_watch_is_bounded() -> None:
    """Count, rate and delays cover the whole stream, and ten times the samples take no more memory."""
    watch, transform = TransformWatch(), stamped("odom", "base", 0)

    def take(ticks: range) -> int:
        for tick in ticks:
            transform.header.stamp.sec = tick
            watch.take([transform], (tick + (tick == 10)) * S)
        return tracemalloc.get_traced_memory()[0]

    tracemalloc.start()
    try:
        first = take(range(1, 2 * WINDOW))
        assert take(range(2 * WINDOW, 20 * WINDOW)) - first < 10_000
    finally:
        tracemalloc.stop()
    (figures,) = watch.figures()
    assert (figures.count, figures.rate, figures.jitter, figures.max_delay) == (20 * WINDOW - 1, 1.0, 0.0, 1.0)
    assert figures.mean_delay == pytest.approx(1.0 / figures.count)
