"""A child that a warm parent has forked, as the launcher sees it; and what the launcher asks the warm parent."""

import contextlib
import logging
import os
import select
import signal
import socket
import threading
from collections.abc import Sequence
from typing import IO

from zteam.clock import HOST_FACTOR
from zteam.launch.fork_protocol import End, Load, Start, receive_reply, send

log = logging.getLogger("zteam")

_PATIENCE = 60.0 * HOST_FACTOR
"""Host seconds for a warm parent to answer: it may have to import from a slow disk first."""
UNKNOWN = 255
"""Exit code of a child whose warm parent was killed, which alone knew it."""


class Orders:
    """The launcher's end of a warm parent's socket."""

    def __init__(self, end: socket.socket) -> None:
        self._end = end
        self._end.settimeout(_PATIENCE)
        self._lock = threading.Lock()

    def load(self, modules: tuple[str, ...]) -> None:
        """Let it import these. Raises OSError."""
        with self._lock:
            send(self._end, Load(modules))

    def ask(self, message: Start | End, descriptors: Sequence[int] = ()) -> int:
        """The number in the reply. Raises OSError; a ConnectionError if there will be no further replies."""
        with self._lock:
            try:
                send(self._end, message, descriptors)
                reply = receive_reply(self._end)
            except TimeoutError:
                # What it says later would be taken for the reply to another message.
                self._end.close()
                raise ConnectionAbortedError(f"the warm parent has not answered for {_PATIENCE:g} s") from None
        if reply.error:
            raise OSError(reply.error)
        return reply.number

    def close(self) -> None:
        """Let it end."""
        self._end.close()


class ForkedChild:
    """A child of a warm parent, used like a `subprocess.Popen`."""

    def __init__(self, pid: int, descriptor: int, parent: Orders) -> None:
        self.pid = pid
        self.returncode: int | None = None
        self.stdin: IO[str] | None = None
        self.stdout: IO[str] | None = None
        self._parent = parent
        self._descriptor = descriptor
        self._released = False
        self._lock = threading.Lock()

    def poll(self) -> int | None:
        """Find out whether it has ended; its exit code."""
        with self._lock:
            if self.returncode is None and self.has_ended(0):
                self.returncode = self._ask(release=False)
        return self.returncode

    def wait_for_end(self) -> None:
        """Wait until it has ended; its process id stays taken."""
        self.has_ended(None)

    def wait(self) -> int:
        """Wait until it has ended, release its process id, and return its exit code."""
        with self._lock:
            if not self._released:
                self.has_ended(None)
                code = self._ask(release=True)
                self.returncode = code if self.returncode is None else self.returncode
                self._released = True
                os.close(self._descriptor)
        assert self.returncode is not None
        return self.returncode

    def send_signal(self, sig: int) -> None:
        """Send it a signal if it still runs."""
        with self._lock:
            if not self._released:
                with contextlib.suppress(ProcessLookupError):
                    signal.pidfd_send_signal(self._descriptor, sig)

    def has_ended(self, timeout: float | None) -> bool:
        """Whether it ends within `timeout` host seconds; None = no limit."""
        # Host time: a process has ended when its descriptor can be read; no time is measured.
        waiting = select.poll()  # noqa: TID251
        waiting.register(self._descriptor, select.POLLIN)
        return bool(waiting.poll(None if timeout is None else 1e3 * timeout))

    def _ask(self, *, release: bool) -> int:
        try:
            return self._parent.ask(End(self.pid, release))
        except OSError as error:
            log.debug("exit code of process %d: %s", self.pid, error)
            return UNKNOWN


def start_child(orders: Orders, start: Start, descriptors: Sequence[int]) -> ForkedChild:
    """Let the warm parent fork a child with this standard input, output, error and lifeline. Raises OSError."""
    pid = orders.ask(start, descriptors)
    try:
        descriptor = os.pidfd_open(pid)
    except OSError:
        # There is none left to watch it with. It must not run beside the one that is spawned in its place.
        os.kill(pid, signal.SIGKILL)
        raise
    return ForkedChild(pid, descriptor, orders)
