"""Sessions at the router that are none of zteam's: where they come from, and which process of this host they are."""

import json
import socket
import struct
from pathlib import Path

import msgspec
import zenoh

from zteam.bus.options import BusOptions, host_port, try_open
from zteam.bus.router import read_record
from zteam.names import declarations_key

_LIMIT = 1.0
"""Host seconds for sessions to answer."""
_MAX_COMMAND = 60
"""Characters of a command line."""


def find_strangers(options: BusOptions) -> list[str]:
    """Each such session in words: id, address, and on this host its process; empty where the router does not tell.

    Every session of zteam answers for its declarations, in whatever namespace it is.
    """
    session = try_open(msgspec.structs.replace(options, namespace=None))
    if session is None:
        return []
    with session:
        routers = session.info.routers_zid()
        record = read_record(session, str(routers[0])) if routers else None
        asked = declarations_key("*")
        known = {str(session.zid()), *_answering(session, asked), *_answering(session, f"*/{asked}")}
    there = record.sessions if record else []
    return [
        _text(each.peer, [link.dst for link in each.links])
        for each in there
        if each.peer not in known and each.whatami != "router"
    ]


def _answering(session: zenoh.Session, asked: str) -> list[str]:
    replies = session.get(asked, timeout=_LIMIT)
    return [str(reply.ok.key_expr).rsplit("/", 2)[1] for reply in replies if reply.ok is not None]


def _text(session: str, addresses: list[str]) -> str:
    owners = filter(None, map(_process_at, addresses))
    return ", ".join([f"session {session}", *addresses, *owners])


def _process_at(endpoint: str) -> str:
    """The process of this host whose end of a connection is at `endpoint`; empty if it is not found."""
    address = host_port(endpoint)
    inode = address and _inode_at(*address)
    if not inode:
        return ""
    for entry in Path("/proc").glob("[0-9]*"):
        try:
            if any(f"socket:[{inode}]" == str(link.readlink()) for link in (entry / "fd").iterdir()):
                command = (entry / "cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace").strip()
                return f"process {entry.name} ({json.dumps(command[:_MAX_COMMAND])[1:-1]})"
        except OSError:
            # Another user's, or it has just ended.
            continue
    return ""


def _inode_at(host: str, port: int) -> str:
    try:
        # As Linux writes it: the address as a number of this machine's byte order.
        shown = f"{struct.unpack('=I', socket.inet_aton(host))[0]:08X}:{port:04X}"
        rows = [row.split() for row in Path("/proc/net/tcp").read_text().splitlines()[1:]]
    except OSError:
        return ""
    return next((row[9] for row in rows if row[1] == shown), "")
