"""`python -P -m zteam.team.launch.fork_server N`: a warm parent. It imports once what children need, and forks them.

It has one thread and opens nothing, so a child begins like a new program. N is the descriptor of a socket, of which
each message is an order; each order has a reply. The launcher's side is `warm_parent.py`.
"""

import contextlib
import gc
import importlib
import os
import runpy
import signal
import socket
import sys
import warnings
from collections.abc import Sequence

import msgspec

from zteam.node.launcher import LINK
from zteam.node.leaving import show_name

MAX_MESSAGE = 1 << 18
"""Bytes."""
_DESCRIPTORS = 5
"""Of a child: standard input, output, error, link to the launcher, folder."""

PRELOADS = (
    "zteam.node.process_node",
    "zteam.node.router",
    "zteam.simulator.world",
    "zteam.team.parts",
    "zteam.transforms.process.node",
    "zteam.team.file.reading",
    "zteam.transforms.urdf",
    "zteam.monitor.process.node",
    "zteam.robot.process.node",
    "zteam.robot.behaviors.registry",
    "zteam.messages.team_codecs",
    "zteam.node.node",
)
"""What the commands of a team import anyway. A missing entry costs the children time and memory, no more."""


class StartChild(msgspec.Struct, array_like=True, frozen=True):
    """Start a child, as `python -P -m module …` does. Its descriptors come along. The reply is its process id."""

    module: str
    arguments: list[str]
    environment: dict[bytes, bytes]


Order = StartChild | int
"""A number is the process id of a child that has ended: end the rest of its group, release the number, and reply with
the exit code, negative for a signal."""
Reply = int | str
"""A text says why there is no number."""


def serve(control: socket.socket) -> StartChild | None:
    """Obey the orders of `control`. Returns in a child what it is to run; None when the other end is gone."""
    orders: msgspec.msgpack.Decoder[Order] = msgspec.msgpack.Decoder(Order)
    while True:
        try:
            data, descriptors, _, _ = socket.recv_fds(control, MAX_MESSAGE, _DESCRIPTORS, socket.MSG_CMSG_CLOEXEC)
        except ConnectionResetError:
            return None
        if not data:
            return None
        order = orders.decode(data)
        reply: Reply
        if isinstance(order, int):
            reply = _collect(order)
        elif len(descriptors) < _DESCRIPTORS:
            # Those for which this process has no room are lost.
            reply = "too many open files in the warm parent"
        else:
            reply = _fork()
            if reply == 0:
                control.close()
                _become(order, descriptors)
                return order
        for descriptor in descriptors:
            os.close(descriptor)
        control.send(msgspec.msgpack.encode(reply))


def _fork() -> Reply:
    """The process id of a child, 0 in the child."""
    # The collector of a child leaves alone what all share: looking through it would copy it.
    gc.freeze()
    try:
        with warnings.catch_warnings():
            # numpy's library for linear algebra has threads; it ends them before a fork.
            warnings.simplefilter("ignore", DeprecationWarning)
            pid = os.fork()
    except OSError as error:
        return str(error)
    # In both processes: the launcher, too, may send a signal to the group at once. It may have ended already.
    with contextlib.suppress(OSError):
        os.setpgid(pid, pid)
    return pid


def _become(start: StartChild, descriptors: Sequence[int]) -> None:
    """Change in a child what a new program would find otherwise."""
    *streams, link, folder = descriptors
    os.fchdir(folder)
    os.close(folder)
    for place, descriptor in enumerate(streams):
        os.dup2(descriptor, place)
        os.close(descriptor)
    os.environb.clear()
    os.environb.update({**start.environment, LINK.encode(): b"%d" % link})
    if "numpy.random" in sys.modules:
        # Python's own generator sees to it that children draw different numbers; numpy's does not.
        sys.modules["numpy.random"].seed()
    gc.enable()


def _collect(pid: int) -> Reply:
    # It may have been the last of its group.
    with contextlib.suppress(OSError):
        os.killpg(pid, signal.SIGKILL)
    try:
        return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
    except OSError as error:
        return str(error)


def main() -> None:
    """Serve, and in a child run the command that was asked for."""
    gc.disable()
    show_name("zteam-parent")
    for module in PRELOADS:
        # The child that needs it imports it again, and says what is wrong.
        with contextlib.suppress(Exception):
            importlib.import_module(module)
    start = serve(socket.socket(fileno=int(sys.argv[1])))
    if start is not None:
        sys.argv[1:] = start.arguments
        runpy.run_module(start.module, run_name="__main__", alter_sys=True)


if __name__ == "__main__":
    main()
