"""What every process is: a node with a name on the bus, one condition to wait on, the team's time, an orderly end."""

import gc
import sys
import threading
import traceback
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from typing import Literal, TypeVar

from zteam import names
from zteam.bus import Bus, BusOptions, connect
from zteam.bus.presence import Claim, ProcessInfo
from zteam.bus.transport import Closeable
from zteam.clock import FREEZES, AutoClock, Rate, WatchedCondition, later, monotonic, to_seconds
from zteam.errors import BusError, UsageError, ZteamError, log
from zteam.messages import Clock, Message, ns_from_time
from zteam.node.faults import log_fault, offer_stacks, place_in
from zteam.node.log_client import LogPublisher
from zteam.node.logs import KEEPER
from zteam.node.shutdown import Stop
from zteam.node.tokens import CertainTokens
from zteam.node.working import watch_process

M = TypeVar("M", bound=Message)
S = TypeVar("S")
R = TypeVar("R")

STEP_LIMIT = 2.0
"""Host seconds that a query waits for the step under way."""
_MOST_LATER = 1000
"""Inputs that are kept during a step; each further one replaces the oldest."""
_CLOSE_LIMIT = 10.0
"""Host seconds that the end of a node waits for the step under way. The hard exit of a process comes before."""
WALL_AFTER = 0.5
"""Host seconds of data without a sign of a simulator after which this is a real base, in wall time."""
ANSWER_LIMIT = 0.5
"""Host seconds for others to answer, before one of them is said to be silent."""
ClockMode = Literal["auto", "sim", "wall"]
"""Which time a process works in: simulated time if there is a simulator, else the host's; or always one of the two."""
SWITCH_INTERVAL = 0.0005
"""Seconds a busy thread keeps the interpreter while a message waits for its callback; 5 ms is Python's default."""


class ProcessNode:
    """One named process on the bus. Its time is the simulator's, of clock or ticks, or the host's where there is none.

    Every input changes state under `changed`. It wakes the main loop, which waits with `wait`, if that waits for it.
    During a step (`take_step`) inputs are kept, and taken when it is over. Nothing here polls. `on_stop` hooks run
    before the session closes, in the order they were added.
    """

    in_team = False
    """Whether a launcher runs it as a member of a team. Launcher and monitor then log what the team waits for."""

    def __init__(self, name: str, bus: Bus, stop: Stop, clock: ClockMode = "auto") -> None:
        self.name = name
        self.bus = bus
        self.stop = stop
        self.lock = threading.RLock()
        """That of `changed`, for code that only takes it: the condition around it would triple the time."""
        self.changed = WatchedCondition(self.lock)
        self.present = self.can_publish = False
        """Whether this process holds its name and has not begun to give it back. If it fails it stays present, but may
        not act and answer any more under the name."""
        self.exit_code = 0
        """Exit code of a process whose body ended without an error."""
        self.clock = AutoClock()
        if clock == "sim":
            self.clock.use_simulated()
        elif clock == "wall":
            self.clock.use_wall()
        self._ended = self._half_jump = 0
        """The time (ns) before its last jump back, and half of that jump."""
        self.clock.on_jump_back(self._note_jump)
        self._failure: BaseException | None = None
        self._busy = False
        """Whether a step is under way."""
        self._later: deque[tuple[Callable[..., object], tuple[object, ...]]] = deque(maxlen=_MOST_LATER)
        """The inputs that have come meanwhile."""
        self.on_input: Callable[[], object] = lambda: None
        """Called without `changed` after each input, which may make a step due."""
        self._on_present: list[Callable[[], object]] = []
        self._on_stop: list[Callable[[], None]] = []
        self.link_up = True
        """Whether this process has a link to the router."""
        self.was_dropped = False
        """Whether the last loss of the link followed from a freeze of this process."""
        self.simulators: set[str] = set()
        """The tokens of simulators that are there, for a process that follows the clock."""
        self._clock_input: Closeable | None = None
        self.ticks_tell_time = False
        """Whether this is lock-step, and time comes with the ticks."""
        self.claim = Claim(bus, name)
        self.claim.under_name.append(bus.serve_stats(name))
        self._call_off_end: Callable[[], None] = lambda: None
        """For when the router is back in time, if this process may wait for it only so long."""
        stop.on_request(self.wake)
        bus.watch_link(self._on_link)

    def reaches_others(self) -> bool:
        """Whether another process answers within ANSWER_LIMIT; if not, the link or the router may be at fault.

        Not for handlers.
        """
        answers = self.bus.find(names.info_key("*"), ProcessInfo, timeout=ANSWER_LIMIT)
        return any(info.name != self.name for _, info in answers)

    # Presence and end

    @property
    def stopping(self) -> bool:
        return self.stop.requested

    def become_present(self) -> None:
        """Win the name and show the presence token. Raises DuplicateNameError that names the holder."""
        self.claim.win(self.stop.request, self._win)
        for hook in self._on_present:
            hook()

    def _win(self) -> None:
        # Before the token: a process that sees the token may ask this one at once.
        self.present, self.can_publish = True, self._failure is None
        self.bus.release()

    def on_present(self, hook: Callable[[], object]) -> None:
        """Run `hook()` once the process holds its name."""
        self._on_present.append(hook)

    def on_stop(self, hook: Callable[[], None]) -> None:
        """Run `hook()` when the node ends, while the session still works."""
        self._on_stop.append(hook)

    def close(self) -> None:
        """Run the stop hooks, give the name back and end the session."""
        with self.changed:
            self.changed.wait_until(lambda: not self._busy, _CLOSE_LIMIT)
            # The hooks publish last. Until the token is gone ticks still come, and must not be answered.
            self.present = self.can_publish = False
        for hook in self._on_stop:
            try:
                hook()
            except Exception as error:
                # A hook that fails must not keep the next one (a zero velocity) from running.
                self.exit_code = log_fault(error)
        self.claim.release()
        self.bus.close()

    def _on_link(self, up: bool) -> None:
        if not up:
            # A router drops a process that is silent for longer than its lease.
            self.was_dropped = FREEZES.has_just_woken()
        what = "its link" if self.was_dropped else "router"
        if up:
            log.warning("%s is back", what)
        elif self.was_dropped:
            log.warning("its link has ended meanwhile: opening another one")
        else:
            log.warning("router lost: waiting for it to come back")
        self.link_up = up
        self._call_off_end()
        limit = None if self.bus.options is None else self.bus.options.give_up
        if not up and limit is not None:
            # Host time: the main loop may be in a user's step, so no other thread can wait.
            self._call_off_end = later(limit, partial(self._end_without_router, limit), "give up")
        self.wake()

    def _end_without_router(self, limit: float) -> None:
        log.error("no router for %g s: stopping, as ZTEAM_GIVE_UP says", limit)
        self.stop.request("the router is gone for good")

    # Inputs

    def subscribe(
        self, key_expr: str, message_type: type[M], callback: Callable[..., object], *, latched: bool = False
    ) -> Closeable:
        """Call `callback(key, message)` under `changed`, then let `wait` look."""
        return self.bus.subscribe(key_expr, message_type, self.handler(callback), latched=latched)

    def watch_tokens(self, key_expr: str, callback: Callable[[str, bool], None]) -> None:
        """Call `callback(key, alive)` under `changed` for presence tokens, then let `wait` look."""
        self.bus.watch_tokens([key_expr], self.handler(callback))

    def handler(self, callback: Callable[..., object]) -> Callable[..., None]:
        """What the bus may call instead of `callback`: it calls that under `changed`, not during a step, and lets
        `wait` look."""

        lock, changed = self.lock, self.changed

        def handle(*content: object) -> None:
            with lock:
                if self._busy:
                    self._later.append((callback, content))
                    return
                callback(*content)
                if changed.awaited:
                    changed.look()
            self.on_input()

        return handle

    # Steps

    def take_step(
        self, begin: Callable[[], S | None], act: Callable[[S], R], end: Callable[[S, R], None] = lambda *_: None
    ) -> None:
        """Take a step if one is due.

        `begin()` returns what the step goes by, or None if none is due; `end(given, result)` takes what `act(given)`
        returned. Both run under `changed`. `act`, which may be a user's code, runs without it: no thread of the bus
        waits for it, and no handler runs at the same time. Inputs that come during the step are taken after it, in
        order. An error of the step ends the process.
        """
        had_input, lock, given = False, self.lock, None
        try:
            with lock:
                if self._busy or not self.can_publish:
                    return
                self._busy = True
                given = begin()
            result = None if given is None else act(given)
        except BaseException as error:
            self.fail(error)
        with lock:
            try:
                # A process that is to stop answers no tick: chance would say what comes first, that or its end.
                if self.can_publish and given is not None and not self.stop.requested:
                    end(given, result)  # type: ignore[arg-type]
            except BaseException as error:
                self.fail(error)
            self._busy = False
            while self._later:
                had_input, (callback, content) = True, self._later.popleft()
                callback(*content)
            if self.changed.awaited:
                self.changed.look()
        if had_input:
            self.on_input()

    @contextmanager
    def between_steps(self) -> Iterator[None]:
        """Within, under `changed`, no step is under way. Raises BusError after STEP_LIMIT."""
        with self.changed:
            self.changed.wait_until(lambda: not self._busy, STEP_LIMIT)
            if self._busy:
                raise BusError(f"a step of {self.name} has not returned for {STEP_LIMIT:g} s")
            yield

    def wait(self, ready: Callable[[], bool], timeout: float, *, by_inputs: bool = True) -> bool:
        """Wait until `ready()`, the stop request, or `timeout` host seconds; return what `ready()` returns.

        Unless `by_inputs`, `ready` is asked at each `wake` alone, not at each input.
        """
        wait_for = self.changed.wait_until if by_inputs else self.changed.wait_for
        with self.changed:
            wait_for(lambda: self.stop.requested or self._failure is not None or ready(), timeout)
            if self._failure is not None:
                raise self._failure
            return ready()

    def fail(self, error: BaseException) -> None:
        """End the process for an error on a thread of the bus: `wait` raises it in the main loop."""
        # The first error is the cause; later ones follow from it.
        self._failure, self.can_publish = self._failure or error, False
        self.wake()

    def wake(self) -> None:
        """Wake all threads that wait, whatever they wait for."""
        with self.changed:
            self.changed.notify_all()

    # Time

    def on_time_reset(self, callback: Callable[[], None]) -> None:
        """Call `callback()` when simulated time jumps back: the world was reset, or its simulator started anew.

        It runs under `changed`, before anything of the new time. An error of it ends the process.
        """
        self.clock.on_jump_back(lambda _old, _new: callback())

    def _note_jump(self, old: int, new: int) -> None:
        self._ended, self._half_jump = old, (old - new) // 2

    def is_of_ended_time(self, stamp: Callable[[], int]) -> bool:
        """Whether a message that comes now was sent before time jumped back, by its `stamp()` (ns; 0 does not tell).

        A process that has not heard of the jump yet goes on for a moment: the aggregator sends its last bundle again,
        and a robot its last status. Their stamps are far ahead of the new time.
        """
        now = self.clock.now()
        return now < self._ended and stamp() > now + self._half_jump

    def follow_clock(self) -> None:
        """Take simulated time from the bus as soon as there is a simulator."""
        self.take_time_from_clock()
        CertainTokens(self.bus, names.tokens_key(names.SIMULATOR), self.handler(self._on_simulator))

    def take_time_from_ticks(self) -> None:
        """In lock-step, take the time from the ticks: the clock would only wake this process once more for each."""
        self.clock.use_simulated()
        self.ticks_tell_time = True
        if self._clock_input is not None:
            self._clock_input.close()
            self._clock_input = None

    def take_time_from_clock(self) -> None:
        """Out of lock-step, take the time from the clock."""
        self.ticks_tell_time = False
        if self._clock_input is None:
            self._clock_input = self.bus.subscribe(names.CLOCK, Clock, self.handler(self._on_clock))

    def set_time(self, stamp: int) -> None:
        """Take simulated time `stamp` (ns); an error of a callback for jumps ends the process."""
        try:
            self.clock.set(stamp)
        except BaseException as error:
            self.fail(error)

    def wait_for_moment(self, pace: Rate) -> bool:
        """Wait until the next moment of `pace` in the team's time, and take it; False if something else comes first."""
        clock = self.clock
        left = to_seconds(pace.left(clock.steady()))
        # Simulated time may stand still for long.
        if not self.wait(lambda: pace.left(clock.steady()) == 0, 0.5 if clock.simulated else min(left, 0.5)):
            return False
        pace.take(clock.steady())
        return True

    def decide_clock(self, first_data: float) -> None:
        """Work in wall time if data (since host time `first_data`; 0 = none) came for WALL_AFTER without a simulator.

        A base cannot be told from a simulator by its data: the simulator's token or clock may come a little later.
        """
        # While it was frozen, no sign could come.
        if not self.clock.decided and first_data and monotonic() - max(first_data, FREEZES.look()) > WALL_AFTER:
            self.clock.use_wall()
            log.info("data without a simulator: working in wall time")

    def _on_clock(self, _key: str, message: Clock) -> None:
        self.clock.use_simulated()
        self.set_time(ns_from_time(message.clock))

    def _on_simulator(self, key: str, alive: bool) -> None:
        (self.simulators.add if alive else self.simulators.discard)(key)
        if alive:
            self.clock.use_simulated()


N = TypeVar("N", bound=ProcessNode)


def run_node(
    name: str,
    options: BusOptions,
    body: Callable[[N], None],
    clock: ClockMode,
    make: Callable[[str, Bus, Stop, ClockMode], N],
) -> int:
    """Run `body(node)` as a command, with signals, hard exit and an interpreter set up for one node; its exit code."""

    def tuned(node: N) -> None:
        # What start-up made stays: the collector need not look through it again and again.
        node.on_present(gc.freeze)
        body(node)

    sys.setswitchinterval(SWITCH_INTERVAL)
    stop = Stop()
    offer_stacks(name, stop)
    stop.install()
    return run_body(name, partial(connect, options, stopping=stop), tuned, stop, clock, make)


def run_body(
    name: str,
    open_bus: Callable[[], Bus],
    body: Callable[[N], None],
    stop: Stop,
    clock: ClockMode,
    make: Callable[[str, Bus, Stop, ClockMode], N],
) -> int:
    """Open the node, run `body(node)` and close; return the exit code. An error is logged, a ZteamError as one line.

    The process stays as its caller set it up: log, switch interval and garbage collector are untouched.
    """
    watch_process()
    with ExitStack() as ends:
        ends.callback(KEEPER.begin())
        try:
            if problem := names.name_problem(name):
                raise UsageError(problem)
            bus = open_bus()
            ends.callback(bus.close)
            # Its log is all that a process without its name publishes: readers are to see why it does not start.
            lines = LogPublisher(bus, name)
            ends.callback(lines.close)
            bus.hold()
            node = make(name, bus, stop, clock)
            node.claim.under_name.append(lines)
            node.on_present(lines.catch_up)
            ends.callback(node.close)
            ends.callback(lines.catch_up)
            # First of all: from here on the hard exit watches, because closing must not hang.
            ends.callback(stop.request, "the process ends")
            body(node)
        except ZteamError as error:
            if stop.requested:
                return 0
            place = place_in(traceback.extract_tb(error.__traceback__)) if isinstance(error, UsageError) else ""
            log.error("%s", f"{place}: {error}" if place else error)
            return error.exit_code
        except Exception as error:
            # Before the node closes, which may log more.
            return log_fault(error)
    return node.exit_code
