"""Fixed transforms that other processes add, and when they go."""

import pytest

from support.aggregator_desk import Desk, Listener, ask_static
from zteam import names
from zteam.bus import MemoryHub
from zteam.errors import BusError
from zteam.transforms.client import StaticReply, StaticRequest


def test_a_frame_goes_with_its_caller(hub: MemoryHub, desk: Desk) -> None:
    """The frame is published while its caller's token is there, and nobody else may add it; another caller's, whose
    session id begins alike, stays."""
    desk.start()
    listener = Listener(hub)
    callers = ["00000000" + "a" * 24, "00000000" + "b" * 24]
    tokens = [hub.bus().declare_token(names.token_key(names.STATIC_CALLER, caller)) for caller in callers]
    for child, caller in zip(("/table", "door"), callers, strict=True):
        assert ask_static(hub, child, 4.0, caller).refused == ""
    assert "publishes table already" in ask_static(hub, "table", 5.0, callers[1]).refused
    assert listener.statics[-1] == {"door": 4.0, "table": 4.0}
    tokens[0].close()
    listener.wait_for_statics({"door": 4.0})


@pytest.mark.usefixtures("desk")
def test_a_frame_is_free_as_soon_as_its_caller_has_gone(hub: MemoryHub) -> None:
    """A second caller gets the frame of a caller that has just ended, without waiting."""
    listener, callers = Listener(hub), [hub.bus(), hub.bus()]
    token = callers[0].declare_token(names.token_key(names.STATIC_CALLER, callers[0].instance))
    ask_static(hub, "table", 4.0, callers[0].instance)
    token.close()
    callers[1].declare_token(names.token_key(names.STATIC_CALLER, callers[1].instance))
    assert ask_static(hub, "table", 5.0, callers[1].instance).refused == ""
    assert listener.statics[-1] == {"table": 5.0}


@pytest.mark.usefixtures("desk")
def test_a_bad_frame_is_refused_to_its_caller(hub: MemoryHub) -> None:
    """Without a rotation, or without what a request needs: the reply says why, and the tree stays."""
    listener, service = Listener(hub), names.service_key(names.AGGREGATOR, "static")
    assert hub.bus().ask(service, StaticReply, StaticRequest("map", "table", "a", qw=0.0)).refused
    with pytest.raises(BusError, match="bad request"):
        hub.bus().ask(service, StaticReply)
    assert listener.statics == []


def test_a_lost_router_takes_no_frames(hub: MemoryHub, desk: Desk) -> None:
    """When the router is back, the frames of callers that still live are there."""
    desk.start()
    listener, caller = Listener(hub), hub.bus()
    key = names.token_key(names.STATIC_CALLER, caller.instance)
    token = caller.declare_token(key)
    ask_static(hub, "table", 4.0, caller.instance)
    token.close()
    desk.link.set_link(False)
    desk.link.set_link(True)
    caller.declare_token(key)
    assert listener.statics[-1] == {"table": 4.0}
