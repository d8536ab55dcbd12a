"""What a launcher and its warm parent say to each other: messages over a Unix socket, with descriptors."""

import os
import socket
from collections.abc import Sequence

import msgspec

PADDING = " " * 8192
"""Last argument of a warm parent: room for the command lines of its children."""
_MAX_MESSAGE = 1 << 18
_MAX_DESCRIPTORS = 4


class Load(msgspec.Struct, tag=True, frozen=True):
    """Import modules while there is nothing else to do; there is no reply. What fails is left to the children."""

    modules: tuple[str, ...]


class Start(msgspec.Struct, tag=True, frozen=True):
    """Start a child: `python -P -m module …`; along come its standard input, output and error, and the
    lifeline.

    The reply is its process id.
    """

    command: list[bytes]
    environment: dict[bytes, bytes]
    folder: bytes
    umask: int
    ignored: list[int]
    """Signals that the launcher ignores."""
    needs: tuple[str, ...] = ()
    """Modules to import first. Others that are to be imported can wait until the child is there."""


class End(msgspec.Struct, tag=True, frozen=True):
    """Ask for the exit code of a child that has ended; with `release` its process id becomes free."""

    pid: int
    release: bool


Message = Load | Start | End


class Reply(msgspec.Struct, frozen=True):
    """A process id or an exit code; or why there is none."""

    number: int = 0
    error: str = ""


_messages = msgspec.msgpack.Decoder(Message)
_replies = msgspec.msgpack.Decoder(Reply)


def make_sockets() -> tuple[socket.socket, socket.socket]:
    """Two ends; each message arrives as a whole."""
    return socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)


def send(end: socket.socket, message: Message | Reply, descriptors: Sequence[int] = ()) -> None:
    """Send a message. Raises OSError if the other end is gone or the message is too long."""
    socket.send_fds(end, [msgspec.msgpack.encode(message)], list(descriptors))


def has_message(end: socket.socket) -> bool:
    """Whether a message is there, or the other end is gone."""
    try:
        end.recv(1, socket.MSG_PEEK | socket.MSG_DONTWAIT)
    except BlockingIOError:
        return False
    except ConnectionResetError:
        return True
    return True


def receive(end: socket.socket) -> tuple[Message, list[int]] | None:
    """The next message with its descriptors; None when the other end is gone."""
    data, descriptors, _, _ = socket.recv_fds(end, _MAX_MESSAGE, _MAX_DESCRIPTORS)
    for descriptor in descriptors:
        os.set_inheritable(descriptor, False)
    return (_messages.decode(data), descriptors) if data else None


def receive_reply(end: socket.socket) -> Reply:
    """The next reply. Raises OSError when the other end is gone."""
    data = end.recv(_MAX_MESSAGE)
    if not data:
        raise ConnectionResetError("the warm parent is gone")
    return _replies.decode(data)
