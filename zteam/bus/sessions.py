"""Which process a session is, tools included, and sessions that share a key which has one publisher at a time."""

import logging
import os
import socket
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import msgspec

from zteam.clock import monotonic
from zteam.names import session_info_key

if TYPE_CHECKING:
    from zteam.bus.bus import Bus

log = logging.getLogger("zteam.bus")

_LIMIT = 0.5
"""Host seconds for a session to answer."""
_MOST = 16
"""Sessions that are asked: a sender can invent them."""
_QUIET = 60.0
"""Host seconds between two lines about a key."""
_MOST_KEYS = 256
_Text = Annotated[str, msgspec.Meta(max_length=255)]


class SessionRequest(msgspec.Struct):
    """Asks a session which process it is, and tells it of others that publish on a key."""

    key: _Text = ""
    rivals: Annotated[list[_Text], msgspec.Meta(max_length=_MOST)] = []


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
        """Others publish on this key of this session's."""
        now = monotonic()
        if now - self._told.get(key, -_QUIET) >= _QUIET and (key in self._told or len(self._told) < _MOST_KEYS):
            self._told[key] = now
            log.warning("%s is also published by %s: end all but one", key, ", ".join(rivals))


def describe_sessions(bus: "Bus", sessions: Sequence[str]) -> dict[str, str]:
    """`name (process PID on HOST)` of each session that answers."""
    return {session: str(info) for session, info in _ask(bus, sessions, "").items()}


def _ask(bus: "Bus", sessions: Sequence[str], key: str) -> dict[str, SessionInfo]:
    """What the sessions answer that do; `key` is the one of which they say whether they publish on it."""
    found = {}
    for session in sessions[:_MOST]:
        for _, info in bus.find(session_info_key(session), SessionInfo, SessionRequest(key), timeout=_LIMIT):
            found[session] = info
    return found


def tell_rivals(bus: "Bus", key: str, sessions: Sequence[str]) -> list[str]:
    """Tell each of these sessions that the others publish on `key` too; what people read for each, in this order."""
    answers = _ask(bus, sessions, key)
    # A sender chooses its time stamps, and with them the session that they name: that one has no part in it.
    forged = [each for each, info in answers.items() if not info.publishes]
    texts = {each: str(answers.get(each) or f"session {each}") for each in sessions if each not in forged}
    if forged:
        texts[""] = "a sender with forged time stamps"
    for session in answers.keys() - forged:
        rivals = [text for each, text in texts.items() if each != session][:_MOST]
        bus.find(session_info_key(session), SessionInfo, SessionRequest(key, rivals), timeout=_LIMIT)
    return list(texts.values())
