"""`zteam.Node` and `zteam.run`: a user's own process that keeps time with the team, in lock-step too."""

import logging
from collections.abc import Callable
from functools import partial
from typing import TypeVar

from zteam import names
from zteam.behaviors.behavior import checked_command
from zteam.bus import Bus, BusOptions, Publisher, connect
from zteam.bus.bus import check_message_type
from zteam.bus.transport import Closeable
from zteam.clock import Every, Rate, to_ns
from zteam.errors import UsageError
from zteam.messages import Message, Tick, Twist, ns_from_time
from zteam.runtime.node import ClockMode, Node
from zteam.runtime.node_gate import NodeGate
from zteam.runtime.node_inputs import NodeInputs
from zteam.runtime.process import run_body
from zteam.runtime.shutdown import Stop, stopping_in_order
from zteam.runtime.step_watch import StepWatch

log = logging.getLogger("zteam")

M = TypeVar("M", bound=Message)

Step = Callable[[int], Twist | None]
"""`step(now)`: a robot's own process (`robot_N`) may return its command, which goes to the wheels."""


def _check_single(key: str) -> None:
    if names.is_wildcard(key) or len(key.split()) != 1:
        raise UsageError(f"{key!r} is no key to publish on: use one without spaces and wildcards, as 'planner/plan'")


def _name_returned(node: str, value: object) -> None:
    kind = type(value).__name__
    log.warning("%s: step returned a %s, which nothing takes: put messages on a publisher", node, kind)


class _HeldStep:
    """The step of the first tick, which is held. GO opens that tick anew; chance decides if it was answered before."""

    _now = -1
    """In ns; -1 for no such step."""
    _command: Twist | None = None

    def forget(self) -> None:
        """Time has begun anew."""
        self._now = -1

    def step(self, tick: Tick, step: Step) -> Twist | None:
        """What `step(now)` returns, or has returned in the same tick before GO."""
        now = ns_from_time(tick.stamp)
        if now == self._now:
            return self._command
        command = step(now)
        self._now, self._command = now if tick.epoch == 0 else -1, command
        return command


class StepNode(Node):
    """One process on the bus under a name of its own.

    Call `subscribe` and `publisher`, then `run(step)`, which calls `step(now)` with the time in ns. In lock-step that
    is once a tick, when all inputs declared with `every_tick` have come for it; the world waits for it. Out
    of lock-step it is every `period` seconds of simulated time, or of the host's time where there is no simulator.
    """

    def __init__(self, name: str, bus: Bus, stop: Stop, clock: ClockMode = "auto") -> None:
        super().__init__(name, bus, stop, clock)
        self._inputs = NodeInputs(self, self._act)
        self._part = self._inputs.part
        self._step: Step = lambda now: None
        self._cmd_vel: Publisher[Twist] | None = None
        self._returned = Every(60.0)
        self._gate: NodeGate | None = None
        self._watch = StepWatch(f"{name}: step", "one is due every", "do less in a step")
        self._period: float | None = None
        """Seconds between two steps in real time; None before `run`."""
        self._held = _HeldStep()
        self.on_time_reset(self._held.forget)

    def publisher(self, key: str, message_type: type[M], *, latched: bool = False) -> Publisher[M]:
        """As in BaseNode. Raises UsageError for a wildcard, and for a type that a key of zteam does not carry."""
        from zteam.bus.topics import type_of_key

        _check_single(key)
        carried = type_of_key(key)
        check_message_type(key, message_type)
        if carried not in (None, message_type):
            raise UsageError(f"{key} carries {carried.ros_type}, not {message_type.ros_type}")
        return super().publisher(key, message_type, latched=latched)

    def subscribe(
        self,
        key_expr: str,
        message_type: type[M],
        callback: Callable[[str, M], None],
        *,
        latched: bool = False,
        wake: bool = True,
        every_tick: bool = False,
    ) -> Closeable:
        """Call `callback(key, message)` for each message, never at the same time as `step`.

        In lock-step messages of the simulator are handled in their tick, before `step`, and those of other processes in
        the tick after the one in which they were sent (`TickMessages`); those of latched keys at once.
        With `every_tick`, a lock-step's `step` waits for the tick's own message: of the key, or of every robot in the
        world if the key is `robot_$*/topic`. Such a message needs a header with the stamp of its tick; `tf` may be
        waited for as well, which ends with the aggregator.
        """
        if every_tick:
            self._inputs.of_ticks.declare(key_expr, message_type)
        take = self._inputs.handler(callback, at_once=latched, every_tick=every_tick)
        if latched:
            return super().subscribe(key_expr, message_type, take, latched=True, wake=wake)
        return self.subscribe_from(key_expr, message_type, take, wake=wake)

    def need(self, lacks: Callable[[Tick], list[str]]) -> None:
        """In lock-step, let `step` wait while `lacks(tick)` names keys; it is asked after each message."""
        self._inputs.of_ticks.need(lacks)

    def watch_tokens(self, key_expr: str, callback: Callable[[str, bool], None]) -> None:
        """Call `callback(key, alive)` for presence tokens, never at the same time as `step`."""

        def handle(key: str, alive: bool) -> None:
            with self.failing():
                callback(key, alive)

        super().watch_tokens(key_expr, handle)

    def run(self, step: Step, *, period: float = 0.1, gate: bool = False) -> None:
        """Call `step(now)` until the process is asked to stop. Raises what `step` raises.

        With `gate` it calls `step` from the monitor's GO on. A robot's own process (`robot_N`) tells the monitor that
        it is ready when all that it subscribes to with `every_tick` has come.

        `step` must not ask the bus (`bus.ask`, a TransformClient): no answer is taken until it returns.
        """
        self._step, self._period = step, period
        robot_id = names.robot_id_of(self.name)
        if robot_id is not None:
            self._cmd_vel = self.bus.publisher(names.robot_key(robot_id, names.CMD_VEL), Twist)
        if gate:
            self._gate = NodeGate(self, self._lacking, lambda: self._part.active)
        self.wakes_with_clock = True
        self.become_present()
        # Only the process that holds the name may publish under it, so not before this.
        self.on_stop(self._halt)
        self._keep_pace(period)

    def _keep_pace(self, period: float) -> None:
        pace: Rate | None = None
        is_open: Callable[[], bool] = (lambda: True) if self._gate is None else self._gate.is_open
        while not self.stopping:
            self.decide_clock(self._inputs.first_data)
            if self._gate is not None:
                self._gate.beat()
            if not self.clock.decided or self.clock.now() == 0:
                self.wait(lambda: self.clock.now() > 0, 0.1)
            elif self._part.expected:
                self.wait(lambda: not self._part.expected, 0.5)
            elif not is_open():
                self.wait(lambda: self._part.active or is_open(), 0.5)
            elif pace is None:
                # The first moment is now.
                pace = Rate(to_ns(period), self.clock.steady() - to_ns(period))
            elif self.wait_for_moment(pace):
                with self.changed:
                    if self._part.expected or self.stopping:
                        continue
                    self._inputs.handle_rest()
                    self._drive(self._ask_step(self.clock.now()))

    def _halt(self) -> None:
        with self.changed:
            self._drive(Twist())
            if self._gate is not None:
                self._gate.stop()

    def _lacking(self) -> list[str]:
        """The inputs that are missing: those of the newest tick, or those that never came where there are no ticks."""
        tick = self._part.tick
        return self._inputs.of_ticks.never_came() if tick is None else self._inputs.of_ticks.lacking(tick)

    def _ask_step(self, now: int) -> Twist | None:
        # In lock-step the next tick waits for it.
        period = 0.0 if self._part.active else self._period
        command = self._watch.run(lambda: self._step(now), period or 0.0, paced=True)
        if command is None:
            return None
        if self._cmd_vel is None:
            if self._returned.due():
                _name_returned(self.name, command)
            return None
        command = checked_command(command, f"{self.name}: step")
        if self._gate is not None:
            self._gate.take(command)
        return command

    def _drive(self, command: Twist | None) -> None:
        if command is not None and self._cmd_vel is not None:
            self._cmd_vel.put(command)

    def _act(self, tick: Tick) -> Twist | None:
        if self._gate is not None and not self._gate.passes([], tick.epoch):
            return None
        return self._held.step(tick, self._ask_step)


def stepping(body: Callable[[StepNode], None]) -> Callable[[StepNode], None]:
    """`body(node)`, with a word to the user if it returned without a step."""

    def checked(node: StepNode) -> None:
        body(node)
        if node._period is None and not node.stopping:
            log.warning("%s: its main has returned without node.run(step), so it took no part in the team", node.name)

    return checked


def run(
    name: str, body: Callable[[StepNode], None], options: BusOptions | None = None, *, clock: ClockMode = "auto"
) -> int:
    """Run `body(node)` as the process `name`; the body calls `node.run(step)`. Returns 0 after an orderly stop.

    Raises SystemExit(1) after an error, which it has logged: the script ends with that code, even if it ignores what
    `run` returns.

    Stops in order on SIGINT and SIGTERM; nothing else of the program changes. Without `options` the environment says
    how to reach the bus, as for every command (`ZTEAM_CONNECT`, `ZTEAM_NAMESPACE`, `ZTEAM_CONFIG`, `ZTEAM_LEASE`).
    """
    if not isinstance(name, str) or not callable(body):
        log.error("zteam.run(name, body) takes a text and a function of the node, not %r and %r", name, body)
        raise SystemExit(2)
    chosen = BusOptions.from_environment() if options is None else options
    stop = Stop()
    with stopping_in_order(stop):
        code = run_body(name, partial(connect, chosen, stopping=stop), stepping(body), stop, clock, make=StepNode)
    if code:
        raise SystemExit(code)
    return code
