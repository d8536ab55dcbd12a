"""Figures of a stream of transforms."""

import pytest

from support.transforms import S, stamped
from zteam.transforms.statistics import WINDOW, TransformWatch


def test_a_watch_measures_rate_jitter_and_delay() -> None:
    """Stamps with gaps of 0.1, 0.1 and 0.4 s give 5 Hz, the jitter of the gaps, and delays by the team's clock."""
    watch = TransformWatch()
    # In no order, the last one before the clock knows of it.
    for stamp, now in ((S + S // 10, S + S // 5), (S, 0), (S + S // 5, S + S // 5), (S + 3 * S // 5, S)):
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


def test_the_figures_are_those_of_the_newest_samples() -> None:
    """What is older than the window is forgotten."""
    watch, stamps = TransformWatch(), [S, *range(10 * S, (10 + WINDOW) * S, S)]
    watch.take([stamped("odom", "base", stamp) for stamp in stamps], 0)
    (figures,) = watch.figures()
    assert (figures.count, figures.rate, figures.jitter) == (WINDOW, 1.0, 0.0)
