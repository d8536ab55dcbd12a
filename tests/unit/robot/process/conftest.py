"""What tests of a robot's process need."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing

import pytest

from support.real_time_robot import RealTimeRobot
from zteam.bus import presence


@pytest.fixture(autouse=True)
def no_claim_waits(monkeypatch: pytest.MonkeyPatch) -> None:
    """In memory a token is seen at once."""
    monkeypatch.setattr(presence, "CLAIM_WAIT", 0.0)


@pytest.fixture
def start() -> Iterator[Callable[..., RealTimeRobot]]:
    """Starts robots, as `RealTimeRobot` does, and ends them after the test."""
    with ExitStack() as stack:
        yield lambda *args, **options: stack.enter_context(closing(RealTimeRobot(*args, **options)))
