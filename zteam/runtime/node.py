"""What every process shares: its name on the bus, its clock, one condition to wait on, and an orderly end."""

import gc
import logging
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Literal, TypeVar

from zteam import names
from zteam.bus import Bus, BusOptions, connect
from zteam.bus.presence import Claim, ProcessInfo
from zteam.bus.transport import Closeable
from zteam.clock import AutoClock, Rate, monotonic, to_seconds, wait_until
from zteam.errors import ZteamError
from zteam.messages import Clock, Message, ns_from_time
from zteam.runtime.faults import log_fault
from zteam.runtime.shutdown import Stop, exit_hard_later

log = logging.getLogger("zteam")

M = TypeVar("M", bound=Message)
N = TypeVar("N", bound="Node")

WALL_AFTER = 0.5
"""Host seconds of data without a sign of a simulator after which this is a real base, in wall time."""
ClockMode = Literal["auto", "sim", "wall"]
CLOCK_MODES: tuple[ClockMode, ...] = ("auto", "sim", "wall")
"""Which time a process works in: the simulator's if there is one, else the host's; or one of the two in any case."""
SWITCH_INTERVAL = 0.0005
"""Seconds a busy thread keeps the interpreter while a message waits for its callback; 5 ms is Python's default."""


class Node:
    """One named process on the bus.

    Everything that arrives changes state under `changed` and wakes the main loop, which waits with `wait`. Nothing
    here polls. `on_stop` hooks run before the session closes, in the order they were added.
    """

    def __init__(self, name: str, bus: Bus, stop: Stop, clock: ClockMode = "auto") -> None:
        self.name = name
        self.bus = bus
        self.stop = stop
        self.clock = AutoClock()
        if clock == "sim":
            self.clock.use_simulated()
        elif clock == "wall":
            self.clock.use_wall()
        self.changed = threading.Condition()
        self.present = False
        """Whether this process holds its name and has not begun to give it back."""
        self.exit_code = 0
        """Of a process whose body ended without an error."""
        self._failure: BaseException | None = None
        self._simulators: set[str] = set()
        self._on_simulator_lost: list[Callable[[], None]] = []
        self.wakes_with_clock = False
        """Whether every tick of the simulator's clock wakes the main loop."""
        self._clock_input: Closeable | None = None
        self._follows_clock = False
        self._on_stop: list[Callable[[], None]] = []
        self.claim = Claim(bus, name)
        bus.serve_stats(name)
        stop.on_request(self.wake)
        bus.watch_link(self._on_link)

    @property
    def stopping(self) -> bool:
        """Whether the process was asked to stop."""
        return self.stop.requested

    @property
    def speaks(self) -> bool:
        """Whether it may act and answer under its name: it holds that, is not being closed and has not failed."""
        return self.present and self._failure is None

    def become_present(self) -> None:
        """Win the name and show the presence token. Raises DuplicateNameError that names the holder."""
        self.claim.win(self._on_rival, self._win)
        # What start-up made stays: the collector need not look through it again and again.
        gc.freeze()

    def _win(self) -> None:
        # Before the token: whoever sees that may speak to this process at once.
        self.present = True

    def on_stop(self, hook: Callable[[], None]) -> None:
        """Run `hook()` when the node ends, while the session still works."""
        self._on_stop.append(hook)

    def follow_clock(self) -> None:
        """Take simulated time from the bus as soon as there is a simulator. A second call does nothing."""
        if not self._follows_clock:
            self._follows_clock = True
            self.take_time_from_clock()
            self.watch_tokens(names.tokens_key(names.SIMULATOR), self._on_simulator)

    def take_time_from_ticks(self) -> None:
        """In lock-step the ticks tell the time: the clock would only wake this process once more for each."""
        self.clock.use_simulated()
        if self._clock_input is not None:
            self._clock_input.close()
            self._clock_input = None

    def take_time_from_clock(self) -> None:
        """Out of lock-step the clock tells the time."""
        if self._clock_input is None:
            self._clock_input = self.subscribe(names.CLOCK, Clock, self._on_clock, wake=False)

    def set_time(self, stamp: int) -> None:
        """Take simulated time `stamp` (ns); an error of a callback for jumps ends the process."""
        try:
            self.clock.sim.set(stamp)
        except BaseException as error:
            self._fail(error)

    def on_simulator_lost(self, callback: Callable[[], None]) -> None:
        """Call `callback()` under `changed` when the last simulator is gone."""
        self._on_simulator_lost.append(callback)

    def subscribe(
        self,
        key_expr: str,
        message_type: type[M],
        callback: Callable[[str, M], None],
        *,
        latched: bool = False,
        wake: bool = True,
    ) -> Closeable:
        """Call `callback(key, message)` under `changed`; then wake the main loop, unless it never waits for this."""

        def handle(key: str, message: M) -> None:
            with self.changed:
                callback(key, message)
                if wake:
                    self.changed.notify_all()

        return self.bus.subscribe(key_expr, message_type, handle, latched=latched)

    def subscribe_payloads(
        self, key_expr: str, message_type: type[Message], callback: Callable[[str, bytes], None]
    ) -> Closeable:
        """Call `callback(key, payload)` under `changed` for messages that it reads in a way of its own; it wakes whom
        it has to. Raising DecodeError refuses one."""

        def handle(key: str, payload: bytes) -> None:
            with self.changed:
                callback(key, payload)

        return self.bus.subscribe_payloads(key_expr, message_type, handle)

    def watch_tokens(self, key_expr: str, callback: Callable[[str, bool], None]) -> None:
        """Call `callback(key, alive)` under `changed` for presence tokens, then wake the main loop."""

        def handle(key: str, alive: bool) -> None:
            with self.changed:
                callback(key, alive)
                self.changed.notify_all()

        self.bus.watch_tokens([key_expr], handle)

    def wait(self, ready: Callable[[], bool], timeout: float) -> bool:
        """Wait until `ready()`, the stop request, or `timeout` host seconds; the answer is `ready()`'s."""
        with self.changed:
            wait_until(self.changed, lambda: self.stop.requested or self._failure is not None or ready(), timeout)
            if self._failure is not None:
                raise self._failure
            return ready()

    @contextmanager
    def failing(self) -> Iterator[None]:
        """What goes wrong within, on a thread of the bus, ends the process: `wait` raises it in the main loop."""
        try:
            yield
        except BaseException as error:
            self._fail(error)

    def _fail(self, error: BaseException) -> None:
        # What follows from the first error says less.
        self._failure = self._failure or error
        self.wake()

    def wait_for_moment(self, pace: Rate) -> bool:
        """Wait until the next moment of `pace` in the team's time, and take it; False if something else comes first."""
        clock = self.clock
        left = to_seconds(pace.left(clock.steady()))
        # Simulated time wakes this as it goes on (see `wakes_with_clock`); it may stand still for long.
        if not self.wait(lambda: pace.left(clock.steady()) == 0, 0.5 if clock.simulated else left):
            return False
        pace.take(clock.steady())
        return True

    def wake(self) -> None:
        """Let `wait` look again."""
        with self.changed:
            self.changed.notify_all()

    def close(self) -> None:
        """Run the stop hooks, give the name back and end the session."""
        with self.changed:
            # The hooks have the last word. Until the token is gone ticks still come, and must not be answered.
            self.present = False
        for hook in self._on_stop:
            try:
                hook()
            except Exception as error:
                # A hook that fails must not keep the next one (a zero velocity) from running.
                self.exit_code = log_fault(error)
        self.claim.release()
        self.bus.close()

    def decide_clock(self, first_data: float) -> None:
        """Work in wall time if data (since host time `first_data`; 0 = none) came for WALL_AFTER without a simulator.

        A base cannot be told from a simulator by its data: the simulator's token or clock may come a little later.
        """
        if not self.clock.decided and first_data and monotonic() - first_data > WALL_AFTER:
            self.clock.use_wall()
            log.info("data without a simulator: working in wall time")

    def _on_clock(self, _key: str, message: Clock) -> None:
        self.clock.use_simulated()
        self.set_time(ns_from_time(message.clock))
        if self.wakes_with_clock:
            self.changed.notify_all()

    def _on_simulator(self, key: str, alive: bool) -> None:
        (self._simulators.add if alive else self._simulators.discard)(key)
        if alive:
            self.clock.use_simulated()
        elif not self._simulators:
            # The next one may not work in lock-step.
            self.take_time_from_clock()
            for callback in self._on_simulator_lost:
                callback()

    def _on_link(self, up: bool) -> None:
        if up:
            log.warning("router is back")
        else:
            log.warning("router lost: waiting for it to come back")
        self.wake()

    def _on_rival(self, info: ProcessInfo) -> None:
        log.error("%s is also held by process %d on %s, which is older: stopping", self.name, info.pid, info.host)
        self.stop.request("another process holds the name")


@contextmanager
def open_node(
    name: str, options: BusOptions, stop: Stop, clock: ClockMode, make: Callable[[str, Bus, Stop, ClockMode], N]
) -> Iterator[N]:
    """A node on a new session, made by `make` and closed on every way out."""
    bus = connect(options, stopping=stop)
    try:
        node = make(name, bus, stop, clock)
    except BaseException:
        bus.close()
        raise
    try:
        yield node
    finally:
        # From here on the hard exit watches: whatever ends the node, closing must not hang.
        stop.request("the process ends")
        node.close()


def run_node(
    name: str,
    options: BusOptions,
    body: Callable[[N], None],
    clock: ClockMode = "auto",
    make: Callable[[str, Bus, Stop, ClockMode], N] = Node,  # type: ignore[assignment]
) -> int:
    """Run `body(node)` as a process: signals, orderly stop, hard exit. The exit code is what a command returns."""
    stop = Stop()
    stop.install()
    exit_hard_later(stop)
    return run_body(name, options, body, stop, clock, make)


def run_body(
    name: str,
    options: BusOptions,
    body: Callable[[N], None],
    stop: Stop,
    clock: ClockMode,
    make: Callable[[str, Bus, Stop, ClockMode], N],
) -> int:
    """Open the node, run `body(node)` and close; the exit code. An error is logged, a ZteamError as one line."""
    sys.setswitchinterval(SWITCH_INTERVAL)
    try:
        with open_node(name, options, stop, clock, make) as node:
            try:
                body(node)
            except ZteamError as error:
                return 0 if stop.requested else _say(error)
            except Exception as error:
                # Before the end, of which there may be more to say.
                return log_fault(error)
    except ZteamError as error:
        return 0 if stop.requested else _say(error)
    return node.exit_code


def _say(error: ZteamError) -> int:
    log.error("%s", error)
    return error.exit_code
