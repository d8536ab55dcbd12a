"""What a session answers: which process it is, tools included, and whether it shares a key that has one publisher."""

import logging
import os
import socket
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import msgspec

from zteam.clock import monotonic

log = logging.getLogger("zteam.bus")

MOST_SESSIONS = 16
"""Sessions that are asked: a sender can invent them."""
_QUIET = 60.0
"""Host seconds between two lines about a key."""
_MOST_KEYS = 256
_Text = Annotated[str, msgspec.Meta(max_length=255)]


class SessionRequest(msgspec.Struct):
    """Asks a session which process it is, and tells it of others that publish on a key."""

    key: _Text = ""
    rivals: Annotated[list[_Text], msgspec.Meta(max_length=MOST_SESSIONS)] = []


class SessionInfo(msgspec.Struct):
    """Answer to `@session/<instance>/info`: which process this is, as it says."""

    name: _Text
    """That of the process on the bus, or the command of a tool."""
    host: _Text
    pid: Annotated[int, msgspec.Meta(ge=0, le=2**32 - 1)]
    publishes: bool = False
    """Whether it publishes on the key that it was asked for."""

    def __str__(self) -> str:
        return f"{self.name} (process {self.pid} on {self.host})"


def own_session_info(name: str, *, publishes: bool) -> SessionInfo:
    """Of this process; without a `name` its command, such as `zteam teleop`."""
    path = Path(sys.argv[0])
    is_tool = path.name == "zteam" or path.parts[-2:] == ("zteam", "__main__.py")
    program = "python" if path.name in ("", "-c") else path.name
    tool = " ".join(["zteam", *sys.argv[1:2]]) if is_tool else program
    return SessionInfo((name or tool)[:255], socket.gethostname()[:255], os.getpid(), publishes)


class RivalLog:
    """Says of a key on which this session publishes that others do too; any program may ask for it."""

    def __init__(self) -> None:
        self._told: dict[str, float] = {}

    def take(self, key: str, rivals: Sequence[str]) -> None:
        now = monotonic()
        if now - self._told.get(key, -_QUIET) >= _QUIET and (key in self._told or len(self._told) < _MOST_KEYS):
            self._told[key] = now
            log.warning("%s is also published by %s: end all but one", key, ", ".join(rivals))
