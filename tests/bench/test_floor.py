"""The floor of a lock-step tick, measured with real processes."""

import pytest

from studies.floor import measure_floor, measure_floor_of
from zteam.config.resources import find_world


@pytest.mark.team
def test_the_floor_is_measured() -> None:
    """A short exchange with two robots loses no tick, and its figures agree with each other."""
    figures = measure_floor(robots=2, beams=16, seconds=0.3, interval=0.05)
    assert (figures.robots, figures.beams, figures.lost) == (2, 16, 0)
    assert figures.ticks_per_s > 0
    assert figures.tick_ms * figures.ticks_per_s == pytest.approx(1e3)
    assert figures.rtf == pytest.approx(0.05 * figures.ticks_per_s)


@pytest.mark.team
def test_a_team_stands_beside_the_floor() -> None:
    """Its ratio to the exchange alone is that of their factors."""
    found = measure_floor_of(find_world("office"), robots=2, beams=90, seconds=2.0)
    assert 0.0 < found.rtf == pytest.approx(found.ratio * found.floor_rtf)
