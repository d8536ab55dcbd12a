"""Every test in this folder runs over both transports."""

from collections.abc import Iterator

import pytest

from support.transports import RouterProcess, Sessions, memory_sessions, zenoh_sessions


@pytest.fixture(scope="session")
def router() -> Iterator[RouterProcess]:
    """One router for all tests of a worker."""
    process = RouterProcess()
    yield process
    process.kill()


@pytest.fixture(params=["memory", "zenoh"])
def sessions(request: pytest.FixtureRequest) -> Iterator[Sessions]:
    """Opens sessions of one transport."""
    if request.param == "memory":
        with memory_sessions() as opened:
            yield opened
    else:
        with zenoh_sessions(request.getfixturevalue("router").endpoint) as opened:
            yield opened
