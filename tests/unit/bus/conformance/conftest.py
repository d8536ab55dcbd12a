"""Every test in this folder runs over both transports, across two routers that are linked, and across the bridge of a
team in one process."""

from collections.abc import Iterator
from contextlib import ExitStack, closing

import pytest

from support.limits import LIMIT
from support.transports import (
    RouterProcess,
    Sessions,
    bridged_sessions,
    memory_sessions,
    wait_until_true,
    zenoh_sessions,
)
from zteam import names
from zteam.bus import Bus, BusOptions, connect
from zteam.bus.transport import Declaration


@pytest.fixture(scope="session")
def router() -> Iterator[RouterProcess]:
    """One router for all tests of a worker."""
    process = RouterProcess()
    yield process
    process.kill()


def _session(router: RouterProcess) -> Bus:
    return connect(BusOptions(connect=router.endpoint, lease=LIMIT), patience=LIMIT)


@pytest.fixture(scope="session")
def second_router(router: RouterProcess) -> Iterator[RouterProcess]:
    """Another one, which is linked to the first."""
    process = RouterProcess("tcp/127.0.0.1:0", "--connect", router.endpoint)
    with closing(_session(router)) as near, closing(_session(process)) as far:
        wait_until_true(lambda: bool(near.query(names.declarations_key(far.instance), list[Declaration])))
    yield process
    process.kill()


_LINKED = pytest.param("linked routers", marks=pytest.mark.ci)


@pytest.fixture(params=["memory", "zenoh", _LINKED, "bridge to memory", "bridge to zenoh"])
def sessions(request: pytest.FixtureRequest) -> Iterator[Sessions]:
    """Opens sessions of one transport, or of two with a bridge between them."""
    with ExitStack() as stack:
        if request.param.endswith("memory"):
            opened = stack.enter_context(memory_sessions())
        else:
            routers = ["router", "second_router"] if request.param == "linked routers" else ["router"]
            opened = stack.enter_context(zenoh_sessions(*(request.getfixturevalue(r).endpoint for r in routers)))
        yield stack.enter_context(bridged_sessions(opened)) if request.param.startswith("bridge") else opened
