"""The processes that `zteam node list` and `zteam doctor` see."""

from support.named_sessions import open_named
from zteam import names
from zteam.bus import MemoryHub
from zteam.cli.node import find_nodes


def test_a_command_that_holds_a_frame_is_no_process_of_the_team(hub: MemoryHub) -> None:
    """The token of `zteam tf static` is for the aggregator: it does not answer, and that is no problem."""
    open_named(hub, "robot_0")
    caller = hub.bus()
    caller.declare_token(names.token_key(names.STATIC_CALLER, caller.instance))
    assert [node.name for node in find_nodes(hub.bus())] == ["robot_0"]
