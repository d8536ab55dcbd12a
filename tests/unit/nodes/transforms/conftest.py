"""Fixtures of the aggregator's tests."""

from collections.abc import Iterator

import pytest

from support.aggregator_desk import Desk
from support.lockstep_doubles import Log, listening
from zteam.bus import MemoryHub


@pytest.fixture
def desk(hub: MemoryHub) -> Iterator[Desk]:
    """An aggregator without its main loop: only callbacks run."""
    desk = Desk(hub)
    yield desk
    desk.end()


@pytest.fixture
def log() -> Iterator[Log]:
    """What is logged during the test."""
    with listening() as lines:
        yield lines
