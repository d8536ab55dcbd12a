"""One object under trial: what it asks besides its view, what its class shares, and how long its steps take."""

import datetime  # noqa: TID251
import logging
import random
import sys
import time  # noqa: TID251
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest

from support.candidates import MINE, Candidate
from zteam.behaviors import Behavior
from zteam.robot.trials import check, subject
from zteam.robot.trials.subject import HeardCalls, shared_state


class Asks(Behavior):
    """Its module is this one."""


def test_clocks_and_chance_are_heard_with_the_line() -> None:
    """The host's clocks by name, and random numbers through whatever function of `random`."""
    heard = HeardCalls(Asks)
    with heard.listening():
        time.time()
        datetime.datetime.now()
        random.gauss(0.0, 1.0)
    assert [*heard.clocks] == ["time.time", "datetime.now"]
    assert heard.clocks["datetime.now"].endswith(": datetime.datetime.now()")
    assert heard.chance["random"].endswith(": random.gauss(0.0, 1.0)")


def test_what_a_library_asks_does_not_count() -> None:
    """A log line looks at the clock, and time.perf_counter only measures; afterwards nothing is watched."""
    heard = HeardCalls(Asks)
    with heard.listening():
        logging.getLogger("mine").warning("a line")
        time.perf_counter()
    time.time()
    assert not heard.clocks
    assert not heard.chance
    assert sys.getprofile() is None


GRID = np.zeros(3)
RANDOM = np.random.default_rng(1)


class Base(Behavior):
    """A class between."""

    seen: list[int] = []  # noqa: RUF012 - the mistake that is looked for


class Mine(Base):
    """Its attributes, those of the class between, and the globals of this module are shared."""

    count = 0

    def __init__(self) -> None:
        super().__init__(None)
        self.own = 0


@lru_cache
def _double(x: int) -> int:
    return 2 * x


def test_what_changed_is_named() -> None:
    """Attributes by class and name, also new ones, and globals; what an object keeps, caches and chance are not."""

    def changed() -> set[str]:
        return {name for name, value in shared_state(Mine).items() if before.get(name) != value}

    before = shared_state(Mine)
    assert not changed()
    mine = Mine()
    mine.own += _double(1)
    RANDOM.random()
    assert not changed()
    Mine.count += 1
    Mine.seen.append(3)
    GRID[0] = 1.0
    Mine.late = True  # type: ignore[attr-defined]
    try:
        assert changed() == {"Mine.count", "Base.seen", "GRID", "Mine.late"}
    finally:
        Mine.count, Mine.seen[:], GRID[0] = 0, [], 0.0
        del Mine.late  # type: ignore[attr-defined]


@pytest.mark.ci
def test_slow_steps_are_found(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Steps that work for longer than a tick are counted, and the line is named that works."""
    monkeypatch.setattr(subject, "TICK", 0.001)
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
    monkeypatch.setattr(subject, "monotonic", lambda: time[0])
    monkeypatch.setattr(subject, "WAIT", patience)
    clock = subject.TrialWatch(Behavior)
    for _ in range(steps):
        with clock.step():
            time[0] += 0.03
    assert (clock.slowness() is not None) == is_slow


def test_a_step_that_does_not_return_ends_the_trials(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A loop without end is said with its line, and no further trial begins."""
    monkeypatch.setattr(subject, "TICK", 0.1)
    monkeypatch.setattr(subject, "HANGS_AFTER", 0.3)
    body = "while not Mine.is_free:\n            x = 1\n        return Twist()\n"
    mine = Candidate(folder, f"{MINE}{body}".replace("seen = []", "is_free = False"))
    try:
        (result,) = mine.try_it()
        assert [fault.text for fault in result.faults] == ["step did not return within 0.3 s"]
        assert result.faults[0].place in (mine.place("while not"), mine.place("x = 1"))
    finally:
        sys.modules[mine.module].Mine.is_free = True
