"""What tests of processes without processes share: a bus in memory, and scripted worlds in lock-step on it."""

from collections.abc import Iterator

import pytest

from support.lockstep_doubles import LONG, SHORT, Worlds
from zteam.bus import MemoryHub
from zteam.nodes.simulator import lockstep


@pytest.fixture
def hub() -> MemoryHub:
    """The bus of the test."""
    return MemoryHub()


@pytest.fixture
def worlds(hub: MemoryHub) -> Iterator[Worlds]:
    """Makes worlds that end with the test."""
    made = Worlds(hub)
    yield made
    made.close()


@pytest.fixture
def patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is sent again: what ends a wait is an event."""
    monkeypatch.setattr(lockstep, "RESEND", LONG)


@pytest.fixture
def hasty(monkeypatch: pytest.MonkeyPatch) -> None:
    """Repeats and complaints come at once."""
    monkeypatch.setattr(lockstep, "RESEND", 0.5 * SHORT)
    monkeypatch.setattr(lockstep, "MAX_RESEND", SHORT)
    monkeypatch.setattr(lockstep, "NAME_AFTER", SHORT)
