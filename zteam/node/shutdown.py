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
from contextlib import ExitStack

from zteam.clock import HOST_FACTOR
from zteam.errors import log
from zteam.node.launcher import take_link
from zteam.node.working import hanging

HARD_EXIT = 1.5 * HOST_FACTOR
"""Seconds from the stop request until the process ends whatever hangs (closing a session can take 10 s)."""

HUNG = 3
"""Exit code of a process that was asked to stop while a step did not return."""

SIGNALS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))


class Stop:
    """A request to stop, from whatever side; `requested` never turns False again."""

    def __init__(self) -> None:
        self.requested = False
        self.reason = ""
        self._callbacks: list[Callable[[], None]] = []
        self._lock = threading.Lock()
        self._on_signal: dict[int, Callable[[], None]] = {}

    def __call__(self) -> bool:
        return self.requested

    def on_request(self, callback: Callable[[], None]) -> None:
        """Call `callback()` from a foreign thread when the request comes, at once if it came already."""
        with self._lock:
            if not self.requested:
                self._callbacks.append(callback)
                return
        callback()

    def on_signal(self, number: int, callback: Callable[[], None]) -> None:
        """From `install` on, call `callback()` from a foreign thread on the signal `number`, which requests no stop."""
        self._on_signal[number] = callback

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

    def install(self, on_repeat: Callable[[], None] = lambda: None, hung: int | None = HUNG) -> ExitStack:
        """Take the stop signals and the parent's death as requests; `on_repeat` hears further signals.

        From the request on, the process has HARD_EXIT seconds to end by itself. `hung` is the exit code if a step does
        not return by then; with None the process is not ended. Closing the returned stack undoes all this and restores
        the handlers. Main thread only.
        """
        reader, writer = socket.socketpair()
        writer.setblocking(False)
        ends = ExitStack()
        # The thread that reads hears the end.
        ends.callback(writer.close)
        # Before the handlers: a signal between the two would be lost.
        ends.callback(signal.set_wakeup_fd, signal.set_wakeup_fd(writer.fileno(), warn_on_full_buffer=False))
        for number in (*SIGNALS, *self._on_signal):
            before = signal.signal(number, lambda *_: None)
            ends.callback(signal.signal, number, signal.SIG_DFL if before is None else before)

        def end_now() -> None:
            log.error("did not stop within %g s: ending now", HARD_EXIT)
            logging.shutdown()
            os._exit(hung if hung and hanging() else 1)

        if hung is not None:
            # Host time: the process may hang, so no other thread can wait.
            timer = threading.Timer(HARD_EXIT, end_now)  # noqa: TID251
            timer.daemon = True
            self.on_request(timer.start)
            ends.callback(timer.cancel)
        threading.Thread(
            target=self._watch_signals, args=(reader, writer, on_repeat), name="signals", daemon=True
        ).start()
        if (link := take_link()) is not None:
            threading.Thread(target=self._watch_launcher, args=(link,), name="launcher", daemon=True).start()
        return ends

    def _watch_signals(self, reader: socket.socket, writer: socket.socket, on_repeat: Callable[[], None]) -> None:
        # `writer` is held here so that its descriptor stays open as long as the interpreter writes to it.
        with reader, writer:
            while data := reader.recv(1):
                if data[0] in self._on_signal:
                    self._on_signal[data[0]]()
                elif data[0] in SIGNALS:
                    if self.requested:
                        on_repeat()
                    self.request(signal.Signals(data[0]).name)

    def _watch_launcher(self, descriptor: int) -> None:
        try:
            while os.read(descriptor, 1):
                pass
        except ConnectionResetError:
            # The launcher has gone before it read a report.
            pass
        except OSError as error:
            log.debug("link to the launcher: %s", error)
            return
        self.request("the launcher is gone")
