"""What Zenoh calls: for messages on its own thread, for all else on a thread of Python's."""

import ctypes
import logging
import queue
import threading
from collections.abc import Callable
from functools import partial
from typing import Any, TypeVar

import zenoh

from zteam.bus.transport import RawSample, SampleHandler

log = logging.getLogger("zteam.bus")

T = TypeVar("T")

_BYTES = "zenoh/bytes"
_THREAD = threading.local()


def _stay() -> None:
    """Make the interpreter keep its state of the current thread, one of Zenoh's own.

    Otherwise it makes that state for every callback and throws it away afterwards: 16 KB of stack mapped and unmapped,
    with their page faults, which takes as long as a short callback. An `Ensure` without its `Release` keeps it.
    """
    ctypes.pythonapi.PyGILState_Ensure()
    _THREAD.stays = True


class Aside:
    """A thread of its own on which Zenoh's callbacks call handlers, in order.

    Zenoh offers the same with a thread for each callback. But those are no daemons, so at exit the interpreter would
    wait for them, and each costs a process 40 KB.
    """

    def __init__(self, period: float | None = None, on_idle: Callable[[], None] = lambda: None) -> None:
        """Each time nothing has come for `period` host seconds, `on_idle()` is called on the thread."""
        self._period, self._on_idle = period, on_idle
        self._waiting: queue.SimpleQueue[Callable[[], None] | None] = queue.SimpleQueue()
        threading.Thread(target=self._work, name="bus", daemon=True).start()

    def callback(self, handler: Callable[[T], None]) -> Any:
        """A Zenoh callback that calls `handler`, which must not wait long: it keeps others from being called."""

        def put(event: T) -> None:
            self._waiting.put(partial(call, handler, event))

        return zenoh.handlers.Callback(put, indirect=False)

    def end(self) -> None:
        """End the thread when all that waits has been handled."""
        self._waiting.put(None)

    def _work(self) -> None:
        while (work := self._next()) is not None:
            work()

    def _next(self) -> Callable[[], None] | None:
        try:
            return self._waiting.get(timeout=self._period)
        except queue.Empty:
            return self._on_idle


def call(handler: Callable[[T], None], event: T) -> None:
    """Call a handler; its error is logged."""
    try:
        handler(event)
    except Exception:
        # It must not end the calls that follow, and no other code sees it.
        log.exception("error in a callback of the bus")


def sample_callback(handler: SampleHandler, stamped: bool) -> Any:
    """A Zenoh callback that calls `handler` with samples; without `stamped` they have neither time nor source."""

    def on_sample(sample: zenoh.Sample) -> None:
        if not hasattr(_THREAD, "stays"):
            _stay()
        if sample.kind != zenoh.SampleKind.PUT:
            return
        encoding = str(sample.encoding)
        if encoding == _BYTES:
            encoding = ""
        key, payload = str(sample.key_expr), sample.payload.to_bytes()
        if not stamped:
            handler(RawSample(key, payload, encoding))
            return
        # "<NTP64>/<id>": the only exact form of a timestamp that Python gets.
        time, _, source = str(sample.timestamp or "").partition("/")
        handler(RawSample(key, payload, encoding, int(time) if time else 0, source))

    # On Zenoh's own thread: no other has to wake up, and messages of all keys are handled in their order.
    return zenoh.handlers.Callback(on_sample, indirect=False)
