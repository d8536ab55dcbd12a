"""The Zenoh transport on a session without a router."""

import pytest
import zenoh

from zteam.bus.session import ZenohTransport
from zteam.errors import BusError

ALONE = '{mode: "peer", scouting: {multicast: {enabled: false}, delay: 0}, listen: {endpoints: []}}'


def test_asking_a_closed_session_is_an_error_of_the_bus() -> None:
    """A thread that asks while its process ends gets an error that it handles like any other."""
    transport = ZenohTransport(zenoh.open(zenoh.Config.from_json5(ALONE)))
    transport.close()
    with pytest.raises(BusError, match="cannot ask robot_1/info"):
        transport.get("robot_1/info", b"", 1.0)
