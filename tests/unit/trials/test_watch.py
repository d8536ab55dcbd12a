"""Steps that take long, or do not return."""

import sys
from pathlib import Path

import pytest

from support.candidates import MINE, Candidate
from zteam.behaviors import Behavior
from zteam.trials import check, watch


def test_slow_steps_are_found(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Steps that work for longer than a tick are counted, and the line is named that works."""
    monkeypatch.setattr(watch, "TICK", 0.001)
    monkeypatch.setattr(check, "_PATIENCE", 0.0)
    monkeypatch.setattr(check, "_LOOK_EVERY", 0.001)
    mine = Candidate(folder, f"{MINE}sum(range(1_000_000))\n        return Twist()\n")
    results = mine.try_it()
    assert len(results) == 1
    faults = {fault.kind: fault for fault in results[0].faults}
    assert [*faults] == ["slow"]
    assert faults["slow"].text.startswith("24 steps took longer than a tick of 0.001 s, the longest ")
    assert faults["slow"].place == mine.place("sum(range")


@pytest.mark.parametrize(("steps", "patience", "is_slow"), [(2, 0.02, False), (3, 0.02, True), (3, 1.0, False)])
def test_steps_that_wait_are_the_machines(
    steps: int, patience: float, is_slow: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Steps that wait without working are a fault only if they are many and long."""
    time = [0.0]
    monkeypatch.setattr(watch, "monotonic", lambda: time[0])
    monkeypatch.setattr(watch, "WAIT", patience)
    clock = watch.Watch(Behavior)
    for _ in range(steps):
        with clock.step():
            time[0] += 0.03
    assert (clock.slowness() is not None) == is_slow


def test_a_step_that_does_not_return_ends_the_trials(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A loop without end is said with its line, and no further trial begins."""
    monkeypatch.setattr(watch, "TICK", 0.1)
    monkeypatch.setattr(watch, "HANGS_AFTER", 0.3)
    body = "while not Mine.is_free:\n            x = 1\n        return Twist()\n"
    mine = Candidate(folder, f"{MINE}{body}".replace("seen = []", "is_free = False"))
    try:
        (result,) = mine.try_it()
        assert [fault.text for fault in result.faults] == ["step did not return within 0.3 s"]
        assert result.faults[0].place in (mine.place("while not"), mine.place("x = 1"))
    finally:
        sys.modules[mine.module].Mine.is_free = True
