"""A named process on the bus: its presence, its inputs, one condition to wait on, and an orderly end."""

import logging
import threading
from collections.abc import Callable
from typing import TypeVar

from zteam.bus import Bus, Publisher
from zteam.bus.presence import Claim, ProcessInfo
from zteam.bus.transport import Closeable
from zteam.messages import Message
from zteam.runtime.change import Change
from zteam.runtime.faults import log_fault
from zteam.runtime.shutdown import Stop

log = logging.getLogger("zteam")

M = TypeVar("M", bound=Message)
T = TypeVar("T")


class _Failing:
    """Hands an error within to `fail`. A generator would take five times as long, and some enter this every tick."""

    def __init__(self, fail: Callable[[BaseException], None]) -> None:
        self._fail = fail

    def __enter__(self) -> None:
        pass

    def __exit__(self, _kind: object, error: BaseException | None, _traceback: object) -> bool:
        if error is not None:
            self._fail(error)
        return True


def _locked(lock: threading.RLock, callback: Callable[[str, T], None]) -> Callable[[str, T], None]:
    """`callback` under a lock."""

    def handle(key: str, value: T) -> None:
        with lock:
            callback(key, value)

    return handle


def _followed_by(callback: Callable[[str, T], None], then: Callable[[], None]) -> Callable[[str, T], None]:
    """`callback`, and `then()` after it."""

    def handle(key: str, value: T) -> None:
        callback(key, value)
        then()

    return handle


class BaseNode:
    """One named process on the bus.

    Every input changes state under `changed`. It wakes the main loop, which waits with `wait`, if that waits for it.
    Nothing here polls. `on_stop` hooks run before the session closes, in the order they were added.
    """

    def __init__(self, name: str, bus: Bus, stop: Stop) -> None:
        self.name = name
        self.bus = bus
        self.stop = stop
        self.lock = threading.RLock()
        """That of `changed`, for code that only takes it: the condition around it would triple the time."""
        self.changed = Change(self.lock)
        self.present = False
        """Whether this process holds its name and has not begun to give it back."""
        self.exit_code = 0
        """Exit code of a process whose body ended without an error."""
        self._failure: BaseException | None = None
        self._failing = _Failing(self._fail)
        self._on_present: list[Callable[[], None]] = []
        self._on_stop: list[Callable[[], None]] = []
        self.claim = Claim(bus, name)
        self.claim.under_name.append(bus.serve_stats(name))
        stop.on_request(self.wake)
        bus.watch_link(self._on_link)

    @property
    def stopping(self) -> bool:
        """Whether the process was asked to stop."""
        return self.stop.requested

    @property
    def speaks(self) -> bool:
        """Whether it may act and answer under its name: it holds the name, is not being closed and has not failed."""
        return self.present and self._failure is None

    def become_present(self) -> None:
        """Win the name and show the presence token. Raises DuplicateNameError that names the holder."""
        self.claim.win(self._on_rival, self._win)
        for hook in self._on_present:
            hook()

    def _win(self) -> None:
        # Before the token: a process that sees the token may ask this one at once.
        self.present = True
        self.bus.holding.release()

    def on_present(self, hook: Callable[[], None]) -> None:
        """Run `hook()` once the process holds its name."""
        self._on_present.append(hook)

    def on_stop(self, hook: Callable[[], None]) -> None:
        """Run `hook()` when the node ends, while the session still works."""
        self._on_stop.append(hook)

    def publisher(self, key: str, message_type: type[M], *, latched: bool = False) -> Publisher[M]:
        """A publisher of `message_type` on `key`, closed with the node.

        With `latched`, a late subscriber gets the last message.
        """
        return self.bus.publisher(key, message_type, latched=latched)

    def subscribe(
        self,
        key_expr: str,
        message_type: type[M],
        callback: Callable[[str, M], None],
        *,
        latched: bool = False,
        wake: bool = True,
    ) -> Closeable:
        """Call `callback(key, message)` under `changed`, then let `wait` look unless `wake` is False."""

        handle = _locked(self.lock, _followed_by(callback, self.changed.look) if wake else callback)
        return self.bus.subscribe(key_expr, message_type, handle, latched=latched)

    def subscribe_from(
        self, key_expr: str, message_type: type[M], callback: Callable[[str, M, str], None], *, wake: bool = False
    ) -> Closeable:
        """As `subscribe`, but call `callback(key, message, source)`, with the id of the sender's session."""

        def handle(key: str, message: M, source: str) -> None:
            with self.lock:
                callback(key, message, source)
                if wake:
                    self.changed.look()

        return self.bus.subscribe_from(key_expr, message_type, handle)

    def subscribe_contents(
        self, key_expr: str, message_type: type[M], callback: Callable[[str, bytes | M], None]
    ) -> Closeable:
        """Call `callback(key, content)` under `changed` with undecoded messages; the main loop is not woken.

        Content is the message's bytes, or the message itself where the bus makes none. Bytes for which `callback`
        raises DecodeError are counted as dropped.
        """

        return self.bus.subscribe_contents(key_expr, message_type, _locked(self.lock, callback))

    def watch_tokens(self, key_expr: str, callback: Callable[[str, bool], None]) -> None:
        """Call `callback(key, alive)` under `changed` for presence tokens, then let `wait` look."""

        self.bus.watch_tokens([key_expr], _locked(self.lock, _followed_by(callback, self.changed.look)))

    def wait(self, ready: Callable[[], bool], timeout: float) -> bool:
        """Wait until `ready()`, the stop request, or `timeout` host seconds; return what `ready()` returns."""
        with self.changed:
            self.changed.wait_until(lambda: self.stop.requested or self._failure is not None or ready(), timeout)
            if self._failure is not None:
                raise self._failure
            return ready()

    def failing(self) -> "_Failing":
        """Let an error within, on a thread of the bus, end the process: `wait` raises it in the main loop."""
        return self._failing

    def _fail(self, error: BaseException) -> None:
        # The first error is the cause; later ones follow from it.
        self._failure = self._failure or error
        self.wake()

    def wake(self) -> None:
        """Wake all threads that wait, whatever they wait for."""
        with self.changed:
            self.changed.notify_all()

    def close(self) -> None:
        """Run the stop hooks, give the name back and end the session."""
        with self.changed:
            # The hooks publish last. Until the token is gone ticks still come, and must not be answered.
            self.present = False
        for hook in self._on_stop:
            try:
                hook()
            except Exception as error:
                # A hook that fails must not keep the next one (a zero velocity) from running.
                self.exit_code = log_fault(error)
        self.claim.release()
        self.bus.close()

    def _on_link(self, up: bool) -> None:
        log.warning("router is back" if up else "router lost: waiting for it to come back")
        self.wake()

    def _on_rival(self, info: ProcessInfo) -> None:
        log.error("%s is also held by process %d on %s, which is older: stopping", self.name, info.pid, info.host)
        self.stop.request("another process holds the name")
