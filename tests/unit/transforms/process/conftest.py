"""Fixtures of the aggregator's tests."""

from collections.abc import Iterator

import pytest

from support.aggregator_desk import Desk
from support.log_capture import LogCapture, captured_log
from zteam.bus import MemoryHub


@pytest.fixture
def desk(hub: MemoryHub) -> Iterator[Desk]:
    """An aggregator without its main loop: only callbacks run."""
    desk = Desk(hub)
    yield desk
    desk.end()


@pytest.fixture
def log() -> Iterator[LogCapture]:
    """What is logged during the test."""
    with captured_log() as lines:
        yield lines
