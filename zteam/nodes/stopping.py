"""How a process ends: on SIGINT, SIGTERM, SIGHUP or its parent's death, in order, and never hanging.

Signal handlers of Python run in the main thread between two bytecodes, where the locks of a condition may be held;
so the handlers do nothing, and a thread that the interpreter's wake-up descriptor tells acts on the signal.
"""

import logging
import os
import signal
import socket
import threading
from collections.abc import Callable

log = logging.getLogger("zteam")

PARENT_PIPE = "ZTEAM_PARENT_PIPE"
"""Environment: number of a descriptor whose end of file says that the launcher is gone."""

HARD_EXIT = 1.5
"""Seconds from the stop request until the process ends whatever hangs (closing a session can take 10 s)."""

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class Stop:
    """A request to stop, from whatever side; `requested` never turns False again."""

    def __init__(self) -> None:
        self.requested = False
        self.reason = ""
        self._callbacks: list[Callable[[], None]] = []
        self._lock = threading.Lock()

    def __call__(self) -> bool:
        return self.requested

    def on_request(self, callback: Callable[[], None]) -> None:
        """Call `callback()` from a foreign thread when the request comes, at once if it came already."""
        with self._lock:
            if not self.requested:
                self._callbacks.append(callback)
                return
        callback()

    def request(self, reason: str) -> None:
        """Ask the process to stop; the first reason stays."""
        with self._lock:
            if self.requested:
                return
            self.requested, self.reason = True, reason
            callbacks = list(self._callbacks)
        log.debug("stop: %s", reason)
        for callback in callbacks:
            callback()

    def install(self, on_repeat: Callable[[], None] = lambda: None) -> None:
        """Take the stop signals and the parent's death as requests; `on_repeat` hears further signals.

        Main thread only.
        """
        reader, writer = socket.socketpair()
        writer.setblocking(False)
        # First of all: between the two a signal would be lost.
        signal.set_wakeup_fd(writer.fileno(), warn_on_full_buffer=False)
        for number in SIGNALS:
            signal.signal(number, lambda *_: None)
        threading.Thread(
            target=self._watch_signals, args=(reader, writer, on_repeat), name="signals", daemon=True
        ).start()
        pipe = os.environ.pop(PARENT_PIPE, None)
        if pipe is not None and pipe.isdigit():
            threading.Thread(target=self._watch_parent, args=(int(pipe),), name="parent", daemon=True).start()

    def _watch_signals(self, reader: socket.socket, writer: socket.socket, on_repeat: Callable[[], None]) -> None:
        # `writer` is held here so that its descriptor stays open as long as the interpreter writes to it.
        while data := reader.recv(1):
            if data[0] in SIGNALS:
                if self.requested:
                    on_repeat()
                self.request(signal.Signals(data[0]).name)
        writer.close()

    def _watch_parent(self, descriptor: int) -> None:
        try:
            while os.read(descriptor, 1):
                pass
        except OSError as error:
            log.debug("parent pipe: %s", error)
            return
        self.request("the launcher is gone")


def exit_hard_later(stop: Stop) -> None:
    """From the stop request on, give the process HARD_EXIT seconds to end by itself."""

    def end() -> None:
        log.error("did not stop within %g s: ending now", HARD_EXIT)
        logging.shutdown()
        os._exit(1)

    def start() -> None:
        timer = threading.Timer(HARD_EXIT, end)
        timer.daemon = True
        timer.start()

    stop.on_request(start)
