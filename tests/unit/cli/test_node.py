"""`zteam node list` on a bus in memory, and the processes that it and `zteam doctor` see."""

import os

from support.commands import Run
from support.named_sessions import open_named
from zteam import __version__, names
from zteam.bus import MemoryHub, NoRequest
from zteam.bus.graph import find_nodes
from zteam.bus.presence import own_info


def test_the_list_is_a_table(tools: MemoryHub, run: Run) -> None:
    """It has a heading and a row a process, also with a long name; a process that does not answer says so."""
    open_named(tools, "a_process_with_a_long_name")
    silent = tools.bus()
    silent.declare_token(names.token_key("robot_0", silent.instance))
    heading, long, hung = run("zteam node list").out.splitlines()
    assert heading.split() == ["process", "host", "pid", "up", "zteam"]
    assert str(os.getpid()) in long
    assert long.endswith(f"  {__version__}")
    assert hung.split() == ["robot_0", "does", "not", "answer", "-", "-", "-"]
    assert heading.index("host") == hung.index("does")


def test_a_process_whose_token_comes_late_is_listed(hub: MemoryHub) -> None:
    """On a crowded machine a session may have an answer before it has the token."""
    bus = hub.bus()
    bus.serve(names.info_key("robot_0"), NoRequest, lambda _: own_info("robot_0", bus.instance, 0))
    assert [found.name for found in find_nodes(hub.bus())] == ["robot_0"]


def test_a_command_that_holds_a_frame_is_no_process_of_the_team(hub: MemoryHub) -> None:
    """The token of `zteam tf static` is for the aggregator: it does not answer, and that is no problem."""
    open_named(hub, "robot_0")
    caller = hub.bus()
    caller.declare_token(names.token_key(names.STATIC_CALLER, caller.instance))
    assert [found.name for found in find_nodes(hub.bus())] == ["robot_0"]


def test_a_process_of_several_names_is_listed_under_each(hub: MemoryHub) -> None:
    """A navigation of several robots holds the name of each."""
    bus = open_named(hub, "nav_1")
    bus.serve(names.info_key("nav_2"), NoRequest, lambda _: own_info("nav_2", bus.instance, 0))
    bus.declare_token(names.token_key("nav_2", bus.instance))
    found = find_nodes(hub.bus())
    assert [(each.name, each.pid) for each in found] == [("nav_1", os.getpid()), ("nav_2", os.getpid())]
