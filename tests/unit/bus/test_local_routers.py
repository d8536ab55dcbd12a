"""The routers of this machine."""

import sys

import pytest

from support.transports import RouterProcess
from zteam.bus.local_routers import find_local_routers


@pytest.mark.skipif(sys.platform != "linux", reason="routers are found in /proc")
def test_a_router_is_found_as_long_as_it_runs() -> None:
    """Its endpoint is the one at which it listens."""
    router = RouterProcess()
    try:
        assert router.endpoint in find_local_routers()
    finally:
        router.kill()
    assert router.endpoint not in find_local_routers()
