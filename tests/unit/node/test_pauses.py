"""Pauses between the steps of a process."""

import pytest

from zteam.clock import FREEZES
from zteam.node import working
from zteam.node.working import Pauses

TICK = 100_000_000
"""Nanoseconds."""


@pytest.mark.parametrize(
    ("ticks", "host", "in_lockstep", "expected"),
    [
        (3, 10.0, False, False),
        (100, 10.0, False, True),
        (100, 0.1, False, False),
        (100, 0.0, True, True),
        (3, 0.0, True, False),
    ],
)
def test_a_pause_is_long_in_both_times(
    monkeypatch: pytest.MonkeyPatch, ticks: int, host: float, in_lockstep: bool, expected: bool
) -> None:
    """In lock-step the time of the ticks alone counts, so that every run is the same."""
    now = 50.0
    monkeypatch.setattr(working, "monotonic", lambda: now)
    found = Pauses()
    assert not found.take(TICK, 0.1, in_lockstep=in_lockstep)
    now += host
    assert found.take((1 + ticks) * TICK, 0.1, in_lockstep=in_lockstep) is expected
    assert not found.take((2 + ticks) * TICK, 0.1, in_lockstep=in_lockstep)


def test_after_a_suspension_the_host_tells_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its clock stood as well, but the freeze is known."""
    monkeypatch.setattr(working, "monotonic", lambda: 50.0)
    found = Pauses()
    found.take(TICK, 0.1, in_lockstep=False)
    monkeypatch.setattr(FREEZES, "look", lambda: 50.1)
    assert found.take(100 * TICK, 0.1, in_lockstep=False)


def test_long_intervals_are_no_pauses() -> None:
    """Of a laser with a scan every second."""
    found = Pauses()
    assert not any(found.take(number * 10 * TICK, 1.0, in_lockstep=True) for number in range(1, 5))
