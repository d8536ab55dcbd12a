"""Fixed transforms that other processes add, and when they go."""

import itertools

import pytest

from support.aggregator_desk import Desk, Listener, S, ask_static
from support.log_capture import LogCapture
from support.transforms import stamped
from zteam import names
from zteam.bus import MemoryHub
from zteam.errors import BusError
from zteam.messages import TFMessage
from zteam.transforms.client import StaticReply, StaticRequest
from zteam.transforms.process import node


@pytest.mark.usefixtures("desk")
def test_a_second_caller_is_refused(hub: MemoryHub) -> None:
    """A frame that a living caller added stays as it is; the reply names that caller."""
    listener, caller = Listener(hub), hub.bus()
    caller.declare_token(names.token_key(names.STATIC_CALLER, caller.instance))
    assert ask_static(hub, "/table", 4.0, caller.instance).refused == ""
    assert "table is said by" in ask_static(hub, "table", 5.0, "f" * 32).refused
    assert listener.statics[-1] == {"table": 4.0}


def test_a_frame_goes_with_its_caller(hub: MemoryHub, desk: Desk) -> None:
    """The frame is published while its caller's token is there; afterwards another caller may add it."""
    desk.start()
    listener, caller = Listener(hub), hub.bus()
    token = caller.declare_token(names.token_key(names.STATIC_CALLER, caller.instance))
    ask_static(hub, "table", 4.0, caller.instance)
    assert listener.statics[-1] == {"table": 4.0}
    token.close()
    listener.wait_for_statics({})
    assert ask_static(hub, "table", 5.0, "f" * 32).refused == ""


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
    """Without a name, without a rotation, or with a loop: the reply says why, and the tree stays."""
    listener, service = Listener(hub), names.service_key(names.AGGREGATOR, "static")
    for request in (
        StaticRequest("map", "", "a"),
        StaticRequest("", "table", "a"),
        StaticRequest("table", "table", "a"),
        StaticRequest("map", "table", "a", qw=0.0),
    ):
        assert hub.bus().ask(service, StaticReply, request).refused
    with pytest.raises(BusError, match="bad request"):
        hub.bus().ask(service, StaticReply)
    assert listener.statics == []


def test_callers_are_told_apart(hub: MemoryHub, desk: Desk) -> None:
    """Session ids that begin alike are different callers."""
    desk.start()
    listener = Listener(hub)
    callers = ["00000000" + "a" * 24, "00000000" + "b" * 24]
    tokens = [hub.bus().declare_token(names.token_key(names.STATIC_CALLER, caller)) for caller in callers]
    for i, caller in enumerate(callers):
        ask_static(hub, f"table_{i}", 1.0, caller)
    tokens[0].close()
    listener.wait(lambda: "table_0" not in listener.statics[-1])
    assert listener.statics[-1] == {"table_1": 1.0}


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


@pytest.mark.ci
def test_callers_have_time_to_find_the_router(
    hub: MemoryHub, desk: Desk, log: LogCapture, monkeypatch: pytest.MonkeyPatch
) -> None:
    """However long the router is away, frames go only with callers that stay away when it is back."""
    now = [1000.0]
    monkeypatch.setattr(node, "monotonic", lambda: now[0])
    desk.start()
    listener, strangers = Listener(hub), itertools.count()

    def pass_by(seconds: float) -> None:
        # Conflicts are logged at the end of a round, after it has looked for losses.
        now[0] += seconds
        child = f"nowhere_{next(strangers)}"
        hub.bus().publisher("robot_9/tf", TFMessage).put(TFMessage([stamped("map", f"/{child}", S)]))
        log.wait_for(f"where {child} is")

    callers = [hub.bus(), hub.bus()]
    tokens = []
    for i, caller in enumerate(callers):
        tokens.append(caller.declare_token(names.token_key(names.STATIC_CALLER, caller.instance)))
        ask_static(hub, f"table_{i}", 4.0, caller.instance)
    desk.link.set_link(False)
    for token in tokens:
        token.close()
    pass_by(60.0)
    desk.link.set_link(True)
    pass_by(0.6)
    callers[0].declare_token(names.token_key(names.STATIC_CALLER, callers[0].instance))
    assert listener.statics[-1] == {"table_0": 4.0, "table_1": 4.0}
    pass_by(60.0)
    assert listener.statics[-1] == {"table_0": 4.0}
