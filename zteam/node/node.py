"""`zteam.Node` and `zteam.run`: a user's own process that keeps time with the team, in lock-step too."""

import logging
from collections.abc import Callable, Sequence
from functools import partial
from itertools import count
from typing import Any, NamedTuple, TypeVar

from zteam import names
from zteam.bus import Bus, BusOptions, Publisher, connect
from zteam.bus.transport import Closeable
from zteam.clock import Every, Rate, monotonic, to_ns
from zteam.errors import UsageError
from zteam.messages import Message, NavigationStatus, RobotDriver, RobotStatus, TeamStatus, Tick, Twist, ns_from_time
from zteam.messages.message import check_message_type
from zteam.messages.topics import is_measured, type_of_key
from zteam.messages.velocity import checked_command
from zteam.node.faults import offer_stacks
from zteam.node.lockstep import Participant
from zteam.node.process_node import ClockMode, ProcessNode, run_body
from zteam.node.robot_status import Readiness, StatusReport, go_epoch
from zteam.node.shutdown import Stop, stopping_in_order
from zteam.node.step_watch import StepWatch
from zteam.node.stopping import StopSwitch
from zteam.node.tick_messages import HeldMessage, TickInputs, TickMessages, stamp_of_tick

log = logging.getLogger("zteam")

M = TypeVar("M", bound=Message)

Step = Callable[[int], Twist | None]
"""`step(now)`: a robot's own process (`robot_N`) may return its command, which goes to the wheels."""
_OF_PROCESSES = (RobotStatus, NavigationStatus, TeamStatus)
"""What processes say of themselves: they say it before there is a simulator, too, so it does not tell of a base."""


class NodeGate:
    """Holds the steps of `node` until GO: what `zteam-robot` does by itself, READY and then GO, behind one option.

    A robot's own process (`robot_N`) also tells the monitor that it is ready. The node's main loop calls `beat` and
    `is_open`; the caller of the others holds `node.changed`.
    """

    def __init__(
        self,
        node: ProcessNode,
        lacking: Callable[[], list[str]],
        in_lockstep: Callable[[], bool],
        stop: StopSwitch | None,
    ) -> None:
        """`lacking()` names the inputs that are missing, `in_lockstep()` says whether ticks call the steps.

        `stop` is that of a robot's own process.
        """
        self._node = node
        self._in_lockstep = in_lockstep
        self._lacking = lacking
        self._readiness = Readiness(gated=True, way_out="zteam-monitor")
        robot_id = names.robot_id_of(node.name)
        self._report: StatusReport | None = None
        if robot_id is not None and stop is not None:
            self._report = StatusReport(node, robot_id, "zteam.Node", self._readiness, in_lockstep, stop)
        self._heartbeat = Every(1.0)
        self._team = TeamStatus()
        """The monitor's newest word."""
        node.subscribe(names.TEAM_STATUS, TeamStatus, self._on_team_status, latched=True)

    def _on_team_status(self, _key: str, status: TeamStatus) -> None:
        self._team = status

    def beat(self) -> None:
        """Find out what is missing, and say once a second what the robot is."""
        with self._node.changed:
            self.passes(self._lacking(), 0)
            if self._heartbeat.due():
                self.say_again()

    def is_open(self) -> bool:
        """In real time: whether the steps may begin, by the monitor's word. In lock-step the ticks carry GO."""
        with self._node.changed:
            return self.passes(self._lacking(), go_epoch(self._team, self._node.clock.now()))

    def passes(self, lacking: Sequence[str], epoch: int) -> bool:
        """Whether the steps may begin: nothing is `lacking` and GO `epoch` holds (0 = none); from then on for good."""
        was_released = self._readiness.released
        if self._readiness.take(lacking, epoch) and not was_released:
            self._readiness.drive("")
        self._tell()
        return self._readiness.released

    def take(self, command: Twist) -> None:
        """The newest command of the node's step."""
        if self._report is not None:
            self._report.take(RobotDriver.BEHAVIOR, command)
            self._tell()
            if self._in_lockstep():
                self._report.keep_up(self._node.clock.now())

    def _tell(self) -> None:
        if self._report is not None and self._node.speaks:
            self._report.tell()

    def say_again(self) -> None:
        """Say what the robot is."""
        if self._report is not None:
            self._report.say_again()

    def stop(self) -> None:
        """Say that the process ends."""
        if self._report is not None:
            self._report.stop()


class _Due(NamedTuple):
    """A step that is due."""

    now: int
    """Its time in ns."""
    tick: Tick | None = None
    """That of lock-step; None in real time."""


class Node(ProcessNode):
    """One process on the bus under a name of its own.

    Call `subscribe` and `publisher`, then `run(step)`, which calls `step(now)` with the time in ns. In lock-step that
    is once a tick, when all inputs declared with `every_tick` have come for it; the world waits for it. Out
    of lock-step it is every `period` seconds of simulated time, or of the host's time where there is no simulator.
    """

    def __init__(self, name: str, bus: Bus, stop: Stop, clock: ClockMode = "auto") -> None:
        """Raises UsageError for a name that no process of a user may have."""
        if problem := names.name_problem(name):
            raise UsageError(problem)
        if names.is_taken(name):
            raise UsageError(f"{name} is the name of a process of every team; choose another name")
        super().__init__(name, bus, stop, clock)
        self._inputs = TickInputs(lambda: self._part.robots)
        self._messages = TickMessages()
        self._numbers = count()
        self._first_data = 0.0
        """Host time of the first message that may be of a base; 0 before."""
        self._part = Participant(self, self._has_inputs, lacks=self._inputs.lacking)
        self.on_input = self._advance
        self._step: Step = lambda now: None
        self._cmd_vel: Publisher[Twist] | None = None
        self._switch: StopSwitch | None = None
        """Of a robot's own process."""
        self._returned = Every(60.0)
        self._gate: NodeGate | None = None
        is_own = names.navigated_robot_of(name) is None
        way_out = "do less in a step" if is_own else "the machine is too busy for it, or it has too many robots"
        self._watch = StepWatch(f"{name}: step", "one is due every", way_out)
        self._period: float | None = None
        """Seconds between two steps in real time; None before `run`."""
        self._held: tuple[int, Twist | None] = -1, None
        """Time (ns) and command of the first tick, which is held: GO opens that tick anew, and chance decides if it was
        answered before."""
        self.on_time_reset(self._forget)

    def _forget(self) -> None:
        """Time has begun anew."""
        self._inputs.forget()
        self._messages.forget()
        self._held = -1, None

    @property
    def was_run(self) -> bool:
        """Whether `run` was called."""
        return self._period is not None

    def publisher(self, key: str, message_type: type[M], *, latched: bool = False) -> Publisher[M]:
        """A publisher of `message_type` on `key`, closed with the node. With `latched`, a late subscriber gets the last
        message.

        Raises UsageError for a wildcard, and for a type that a key of zteam does not carry.
        """
        if names.is_wildcard(key) or len(key.split()) != 1:
            raise UsageError(
                f"{key!r} is no key to publish on: use one without spaces and wildcards, as 'planner/plan'"
            )
        carried = type_of_key(key)
        check_message_type(key, message_type)
        if carried not in (None, message_type):
            raise UsageError(f"{key} carries {carried.ros_type}, not {message_type.ros_type}")
        return self.bus.publisher(key, message_type, latched=latched)

    def subscribe(
        self,
        key_expr: str,
        message_type: type[M],
        callback: Callable[[str, M], None],
        *,
        latched: bool = False,
        every_tick: bool = False,
    ) -> Closeable:
        """Call `callback(key, message)` for each message, never at the same time as `step`: what comes during a step is
        taken after it.

        In lock-step messages of the simulator are handled in their tick, before `step`, and those of other processes in
        the tick after the one in which they were sent (`TickMessages`); those of latched keys at once.
        With `every_tick`, a lock-step's `step` waits for the tick's own message: of the key, or of every robot in the
        world if the key is `robot_$*/topic`. Such a message needs a header with the stamp of its tick; `tf` may be
        waited for as well, which ends with the aggregator.
        """
        if every_tick:
            self._inputs.declare(key_expr, message_type)
        number, handle = next(self._numbers), self._failing(callback)

        def take(key: str, message: Message, source: str = "") -> None:
            # A latched message may be the aggregator's, which is there before the simulator.
            if not (latched or isinstance(message, _OF_PROCESSES)):
                self._first_data = self._first_data or monotonic()
            if (every_tick or isinstance(message, RobotStatus)) and self.ended_time.has(
                key, lambda: stamp_of_tick(message), self.clock.now()
            ):
                return
            part, due = self._part, stamp_of_tick(message) if every_tick else None
            if latched or not part.active:
                handle(key, message)
            else:
                arrival = HeldMessage(number, key, message, source, part.is_simulator(source), due, handle)
                if problem := self._messages.take(arrival, part.stamp, is_open=part.is_open):
                    self.bus.counters.drop(key, problem)
                    return
            if due is not None:
                self._inputs.take(key, due)
                if key == names.TF or is_measured(key):
                    part.take_stamp(due)

        if latched:
            return super().subscribe(key_expr, message_type, take, latched=True)
        return self.subscribe_from(key_expr, message_type, take)

    def need(self, lacks: Callable[[Tick], list[str]]) -> None:
        """In lock-step, let `step` wait while `lacks(tick)` names keys; it is asked after each message."""
        self._inputs.need(lacks)

    def watch_tokens(self, key_expr: str, callback: Callable[[str, bool], None]) -> None:
        """Call `callback(key, alive)` for presence tokens, never at the same time as `step`."""
        super().watch_tokens(key_expr, self._failing(callback))

    def _failing(self, callback: Callable[[str, Any], None]) -> Callable[..., None]:
        """A user's `callback`, whose error ends the process."""

        def handle(key: str, value: Any, _tick: int = 0) -> None:
            try:
                callback(key, value)
            except BaseException as error:
                self.fail(error)

        return handle

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
            self._switch = StopSwitch(self.bus, robot_id, self._on_switch)
            self.on_present(self._learn_stop)
        if gate:
            self._gate = NodeGate(self, self._lacking, lambda: self._part.active, self._switch)
        self.become_present()
        log.info("node %s, a step every %g s%s", self.name, period, ": waiting for the monitor's GO" if gate else "")
        # Only the process that holds the name may publish under it, so not before this.
        self.on_stop(self._halt)
        self._keep_pace(period)

    def _keep_pace(self, period: float) -> None:
        pace: Rate | None = None
        is_open: Callable[[], bool] = (lambda: True) if self._gate is None else self._gate.is_open
        while not self.stopping:
            self.decide_clock(self._first_data)
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
                self.take_step(self._begin_moment, self._ask_step, self._end_step)

    @property
    def _may_step(self) -> bool:
        """Whether it is known if the robot of this process is stopped."""
        return self._switch is None or self._switch.is_known

    def _learn_stop(self) -> None:
        assert self._switch is not None
        self._switch.learn()
        self._advance()

    def _on_switch(self) -> None:
        """A query has stopped or released its robot: out of lock-step at once, else from the next tick on."""
        if self._part.active:
            return
        self._drive(None)
        if self._gate is not None:
            self._gate.say_again()

    def _halt(self) -> None:
        with self.changed:
            self._drive(Twist())
            if self._gate is not None:
                self._gate.stop()

    def _lacking(self) -> list[str]:
        """The inputs that are missing: those of the newest tick, or those that never came where there are no ticks."""
        tick = self._part.tick
        return self._inputs.never_came() if tick is None else self._inputs.lacking(tick)

    # A step: `_begin_moment` or `_begin_tick`, then `_ask_step`, then `_end_step`

    def _advance(self) -> None:
        """Lock-step: take the step of the open tick, if its inputs are there."""
        if self._part.is_open:
            self.take_step(self._begin_tick, self._ask_step, self._end_step)

    def _begin_moment(self) -> _Due | None:
        """Real time: the step of now."""
        if self._part.expected or self.stopping:
            return None
        self._messages.handle_due(None)
        return _Due(self.clock.now())

    def _begin_tick(self) -> _Due | None:
        """Lock-step: the step of the open tick. One that needs none is answered at once."""
        tick = self._part.begin()
        if tick is None:
            return None
        now = ns_from_time(tick.stamp)
        if self._gate is not None and not self._gate.passes([], tick.epoch):
            self._part.answer(tick, None)
            return None
        if now == self._held[0]:
            self._part.answer(tick, self._held[1])
            return None
        return _Due(now, tick)

    def _ask_step(self, due: _Due) -> Twist | None:
        # In lock-step the next tick waits for it.
        period = self._period if due.tick is None else 0.0
        command = self._watch.run(lambda: self._step(due.now), period or 0.0, paced=True)
        return None if command is None else self._checked(command)

    def _checked(self, command: Twist) -> Twist | None:
        if self._cmd_vel is not None:
            return checked_command(command, f"{self.name}: step")
        if self._returned.due():
            kind = type(command).__name__
            log.warning("%s: step returned a %s, which nothing takes: put messages on a publisher", self.name, kind)
        return None

    def _end_step(self, due: _Due, command: Twist | None) -> None:
        if command is not None and self._switch is not None and self._switch.is_stopped:
            command = Twist()
        if command is not None and self._gate is not None:
            self._gate.take(command)
        if due.tick is None:
            self._drive(command)
        else:
            self._held = due.now if due.tick.epoch == 0 else -1, command
            self._part.answer(due.tick, command)

    def _drive(self, command: Twist | None) -> None:
        if self._switch is not None and self._switch.is_stopped:
            command = Twist()
        if command is not None and self._cmd_vel is not None:
            self._cmd_vel.put(command)

    def _has_inputs(self, tick: Tick) -> bool:
        self._messages.handle_due(self._part.stamp)
        # A message that was due may have ended the process.
        return self.speaks and self._may_step and not self._inputs.lacking(tick)


def stepping(body: Callable[[Node], None]) -> Callable[[Node], None]:
    """`body(node)`, with a word to the user if it returned without a step."""

    def checked(node: Node) -> None:
        body(node)
        if not (node.was_run or node.stopping):
            log.warning("%s: its main has returned without node.run(step), so it took no part in the team", node.name)

    return checked


def run(
    name: str, body: Callable[[Node], None], options: BusOptions | None = None, *, clock: ClockMode = "auto"
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
    offer_stacks(name, stop)
    with stopping_in_order(stop):
        code = run_body(name, partial(connect, chosen, stopping=stop), stepping(body), stop, clock, make=Node)
    if code:
        raise SystemExit(code)
    return code
