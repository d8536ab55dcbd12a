"""`zteam.Node` and `zteam.run`: a user's own process that keeps time with the team, in lock-step too."""

import logging
from collections.abc import Callable
from typing import Any, TypeVar

from zteam import names
from zteam.behaviors.behavior import checked_command
from zteam.bus import Bus, BusOptions, Publisher
from zteam.bus.bus import check_message_type
from zteam.bus.transport import Closeable
from zteam.clock import Rate, monotonic, to_ns
from zteam.errors import UsageError
from zteam.messages import Message, TFMessage, Tick, Twist, ns_from_time
from zteam.runtime.node import ClockMode, Node
from zteam.runtime.participant import Participant
from zteam.runtime.process import run_body
from zteam.runtime.shutdown import Stop, stopping_in_order
from zteam.tf.bases import bases_stamp

log = logging.getLogger("zteam")

M = TypeVar("M", bound=Message)

Step = Callable[[int], Twist | None]
"""`step(now)`: a robot's own process (`robot_N`) may return its command, which goes to the wheels."""


class StepNode(Node):
    """One process on the bus under a name of its own.

    Call `subscribe` and `publisher`, then `run(step)`, which calls `step(now)` with the time in ns. In lock-step that
    is once a tick, when all inputs declared with `every_tick` have come for it; the world waits for it. Out
    of lock-step it is every `period` seconds of simulated time, or of the host's time where there is no simulator.
    """

    def __init__(self, name: str, bus: Bus, stop: Stop, clock: ClockMode = "auto") -> None:
        super().__init__(name, bus, stop, clock)
        self._needs: list[Callable[[Tick], list[str]]] = []
        self._stamps: dict[str, int] = {}
        """Of the newest message, by key."""
        self._step: Step = lambda now: None
        self._cmd_vel: Publisher[Twist] | None = None
        self._first_data = 0.0
        """Host time of the first message; 0 before."""
        self._advance: Callable[[], object] = lambda: None
        """Called after each message; the clock may come before the participant is made."""
        self._part = Participant(self, self._has_inputs, self._act, lacks=self._lacks)
        self._advance = self._part.advance
        self.on_time_reset(self._stamps.clear)

    def publisher(self, key: str, message_type: type[M], *, latched: bool = False) -> Publisher[M]:
        """As in BaseNode. Raises UsageError for a type that a key of zteam does not carry: all would refuse it."""
        from zteam.bus.topics import type_of_key

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

        With `every_tick`, a lock-step's `step` waits for the tick's own message: of the key, or of every robot in the
        world if the key is `robot_$*/topic`. Such a message needs a header with the stamp of its tick; `tf` may be
        waited for as well, which ends with the aggregator.
        """
        if every_tick and "header" not in message_type.__struct_fields__ and message_type is not TFMessage:
            raise UsageError(f"{key_expr}: {message_type.__name__} has no header, so its tick cannot be told")
        if every_tick:
            self.need(lambda tick: self._not_come(key_expr, tick))

        def handle(key: str, message: Any) -> None:
            self._first_data = self._first_data or monotonic()
            with self.failing():
                callback(key, message)
            if every_tick:
                self._stamps[key] = _stamp_of(message)
                self._part.take_stamp(self._stamps[key])
            self._advance()

        return super().subscribe(key_expr, message_type, handle, latched=latched, wake=wake)

    def need(self, lacks: Callable[[Tick], list[str]]) -> None:
        """In lock-step, let `step` wait while `lacks(tick)` names keys; it is asked after each message."""
        self._needs.append(lacks)

    def watch_tokens(self, key_expr: str, callback: Callable[[str, bool], None]) -> None:
        """Call `callback(key, alive)` for presence tokens, never at the same time as `step`."""

        def handle(key: str, alive: bool) -> None:
            with self.failing():
                callback(key, alive)

        super().watch_tokens(key_expr, handle)

    def run(self, step: Step, *, period: float = 0.1) -> None:
        """Call `step(now)` until the process is asked to stop. Raises what `step` raises.

        `step` must not ask the bus (`bus.ask`, a TransformClient): no answer is taken until it returns.
        """
        self._step = step
        robot_id = names.robot_id_of(self.name)
        if robot_id is not None:
            self._cmd_vel = self.bus.publisher(names.robot_key(robot_id, names.CMD_VEL), Twist)
            self.on_stop(lambda: self._drive(Twist()))
        self.wakes_with_clock = True
        self.become_present()
        pace: Rate | None = None
        while not self.stopping:
            self.decide_clock(self._first_data)
            if pace is None and self.clock.decided and self.clock.now() > 0:
                # The first moment is now.
                pace = Rate(to_ns(period), self.clock.steady() - to_ns(period))
            if pace is None:
                self.wait(lambda: self.clock.now() > 0, 0.1)
            elif self._part.active:
                self.wait(lambda: not self._part.active, 0.5)
            elif self.wait_for_moment(pace):
                with self.changed:
                    if self._part.active or self.stopping:
                        continue
                    self._drive(self._ask_step(self.clock.now()))

    def _ask_step(self, now: int) -> Twist | None:
        command = self._step(now)
        if self._cmd_vel is None:
            return None
        return None if command is None else checked_command(command, f"{self.name}: step")

    def _drive(self, command: Twist | None) -> None:
        if command is not None and self._cmd_vel is not None:
            self._cmd_vel.put(command)

    def _has_inputs(self, tick: Tick) -> bool:
        return not self._lacks(tick)

    def _lacks(self, tick: Tick) -> list[str]:
        return [key for lacks in self._needs for key in lacks(tick)]

    def _not_come(self, key_expr: str, tick: Tick) -> list[str]:
        """The `every_tick` key, or that key of each robot, whose message of the tick has not come."""
        if key_expr == names.TF and names.AGGREGATOR not in tick.participants:
            # Nothing sends the transforms of this tick.
            return []
        keys = [key_expr]
        if key_expr.startswith(names.all_robots_key("")):
            keys = [names.robot_key(robot_id, key_expr.partition("/")[2]) for robot_id in self._part.robots]
        stamp = ns_from_time(tick.stamp)
        return [key for key in keys if self._stamps.get(key, -1) < stamp]

    def _act(self, tick: Tick) -> Twist | None:
        return self._ask_step(ns_from_time(tick.stamp))


def _stamp_of(message: Any) -> int:
    if isinstance(message, TFMessage):
        return bases_stamp(message)
    return ns_from_time(message.header.stamp)


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
        code = run_body(name, chosen, body, stop, clock, make=StepNode)
    if code:
        raise SystemExit(code)
    return code
