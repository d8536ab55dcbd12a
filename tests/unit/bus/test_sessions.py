"""What a session is called for people."""

import sys

import pytest

from zteam.bus import MemoryHub
from zteam.bus.bus import SessionInfo
from zteam.names import session_info_key


@pytest.mark.parametrize(
    ("argv", "name"),
    [
        (["/usr/bin/zteam", "teleop", "0"], "zteam teleop"),
        (["crowd-c.py"], "crowd-c.py"),
        (["-c"], "python"),
        ([""], "python"),
    ],
)
def test_a_tool_is_called_by_its_command(
    argv: list[str], name: str, hub: MemoryHub, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A session without a process of its own on the bus bears the name of its command."""
    monkeypatch.setattr(sys, "argv", argv)
    assert hub.bus().ask(session_info_key("*"), SessionInfo).name == name
