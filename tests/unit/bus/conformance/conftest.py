"""Every test in this folder runs over both transports, and across the bridge of a team in one process."""

from collections.abc import Iterator
from contextlib import ExitStack

import pytest

from support.transports import RouterProcess, Sessions, bridged_sessions, memory_sessions, zenoh_sessions


@pytest.fixture(scope="session")
def router() -> Iterator[RouterProcess]:
    """One router for all tests of a worker."""
    process = RouterProcess()
    yield process
    process.kill()


@pytest.fixture(params=["memory", "zenoh", "bridge to memory", "bridge to zenoh"])
def sessions(request: pytest.FixtureRequest) -> Iterator[Sessions]:
    """Opens sessions of one transport, or of two with a bridge between them."""
    with ExitStack() as stack:
        if request.param.endswith("memory"):
            opened = stack.enter_context(memory_sessions())
        else:
            opened = stack.enter_context(zenoh_sessions(request.getfixturevalue("router").endpoint))
        yield stack.enter_context(bridged_sessions(opened)) if request.param.startswith("bridge") else opened
