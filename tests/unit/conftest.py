"""Fixtures of tests that run processes' parts in one process: a bus in memory, and lock-step on it."""

from collections.abc import Iterator

import pytest

from support.lockstep_doubles import LONG, SHORT, HarnessFactory
from zteam.bus import MemoryHub
from zteam.node import process_node
from zteam.simulator.process import lockstep


@pytest.fixture(scope="session", autouse=True)
def without_freezes() -> Iterator[None]:
    """A crowded machine may freeze the tests' own process: a log would have a line that its test does not expect."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(process_node, "watch_process", lambda: None)
        yield


@pytest.fixture
def hub() -> MemoryHub:
    """The bus of the test."""
    return MemoryHub()


@pytest.fixture
def new_harness(hub: MemoryHub) -> Iterator[HarnessFactory]:
    """Makes lock-step harnesses that end with the test."""
    made = HarnessFactory(hub)
    yield made
    made.close()


@pytest.fixture
def patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """No tick is sent again: only an event ends a wait."""
    monkeypatch.setattr(lockstep, "RESEND", LONG)


@pytest.fixture
def hasty(monkeypatch: pytest.MonkeyPatch) -> None:
    """Repeats and warnings come at once."""
    monkeypatch.setattr(lockstep, "RESEND", 0.5 * SHORT)
    monkeypatch.setattr(lockstep, "MAX_RESEND", SHORT)
    monkeypatch.setattr(lockstep, "NAME_AFTER", SHORT)
