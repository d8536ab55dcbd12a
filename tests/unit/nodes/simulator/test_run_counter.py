"""From which tick on a run is counted, and when it is over."""

from collections.abc import Iterator

import pytest

from support.simulator_parts import SimulatorParts
from zteam.bus import MemoryHub


@pytest.fixture
def parts(hub: MemoryHub) -> Iterator[SimulatorParts]:
    """A run of half a second, without a main loop."""
    made = SimulatorParts(hub, run_for=0.5)
    yield made
    made.close()


def test_no_tick_counts_before_go(parts: SimulatorParts) -> None:
    """However many there are."""
    for _ in range(10):
        assert not parts.whole_tick()
    assert (parts.is_counting, parts.statistics.ticks) == (False, 0)


def test_a_run_is_over_its_time_after_go(parts: SimulatorParts) -> None:
    """GO in tick 2 of 0.1 s each: tick 7 is the last one."""
    parts.whole_tick()
    parts.whole_tick()
    parts.take_go(parts.engine.now)
    assert [parts.whole_tick() for _ in range(5)] == [False, False, False, False, True]
    assert parts.statistics.ticks == 5


def test_only_the_first_go_counts(parts: SimulatorParts) -> None:
    """A later one does not prolong the run."""
    parts.whole_tick()
    parts.take_go(parts.engine.now)
    parts.whole_tick()
    parts.take_go(parts.engine.now)
    parts.whole_tick()
    assert parts.statistics.go_stamp == parts.world.interval


def test_a_go_of_an_earlier_simulator_holds_from_now_on(parts: SimulatorParts) -> None:
    """Its stamp may lie beyond this simulator's time."""
    parts.whole_tick()
    parts.take_go(10**15)
    parts.whole_tick()
    assert parts.statistics.go_stamp == parts.world.interval


def test_after_a_reset_go_holds_from_the_first_tick_on(parts: SimulatorParts) -> None:
    """The count begins again with it."""
    for _ in range(3):
        parts.whole_tick()
    parts.take_go(parts.engine.now)
    parts.whole_tick()
    parts.reset()
    assert not parts.is_counting
    parts.whole_tick()
    assert (parts.statistics.go_stamp, parts.statistics.ticks) == (parts.world.interval, 1)
