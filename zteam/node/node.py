"""`zteam.Node` and `zteam.run`: a user's own process that keeps time with the team, in lock-step too."""

import math
import threading
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from itertools import count
from numbers import Real
from traceback import extract_stack
from typing import Any, TypeVar

import msgspec

from zteam import names
from zteam.bus import Bus, BusOptions, Deferred, NoRequest, Publisher, connect
from zteam.bus.graph import find_graph, unpublished
from zteam.bus.transport import Closeable, RawSample, let_end
from zteam.clock import Every, Rate, monotonic, to_ns
from zteam.errors import BusError, UsageError, check_call, log
from zteam.messages import Message, NavigationStatus, RobotDriver, RobotStatus, TeamState, TeamStatus, Tick, Twist
from zteam.messages.message import check_message_type
from zteam.messages.planar import checked_command
from zteam.messages.topics import type_of_key
from zteam.node.faults import offer_stacks, place_in
from zteam.node.lockstep import Lacking, Participant, TickState
from zteam.node.process_node import ClockMode, ProcessNode, run_body
from zteam.node.robot_status import Readiness, StatusReport, go_epoch
from zteam.node.shutdown import Stop
from zteam.node.steps import Act, Due, Step, StepTimer
from zteam.node.stopping import STOPS, StopSwitch
from zteam.node.tick_messages import Handle, HeldMessage, TickInputs, TickMessages, stamp_of_tick
from zteam.node.working import StepWatch

M = TypeVar("M", bound=Message)
Request = TypeVar("Request", bound=msgspec.Struct)

HEARTBEAT = 1.0
"""Host seconds between two heartbeats."""
_SEARCH_AFTER = 5.0
"""Host seconds, or simulated seconds of its steps, without a message after which a node looks whether anything
publishes it."""


class UserStep:
    """The steps of a user's node, `step(now)`, and their timer in real time: every `period` seconds."""

    def __init__(self, node: "Node", step: Step, period: float) -> None:
        self._node, self._step, self._period = node, step, period
        is_own = names.navigated_robot_of(node.name) is None
        way_out = "do less in a step" if is_own else "the machine is too busy for it, or it has too many robots"
        self._watch = StepWatch(f"{node.name}: step", "one is due every", way_out)
        self._returned = Every(60.0)
        self._rate: Rate | None = None
        """The moments of its steps. In lock-step the next tick takes the moment that has come."""
        self._is_due = False
        self._forget()
        node.on_time_reset(self._forget)

    def _forget(self) -> None:
        self._held: tuple[int, Twist | None] = -1, None
        """Time (ns) and command of the first tick, which is held: GO opens that tick anew, and chance decides if it was
        answered before."""

    def wait(self, limit: float) -> None:
        """Wait for simulated time, then for GO, then for the next moment."""
        node, clock = self._node, self._node.clock
        if not clock.decided or clock.now() == 0:
            node.wait(lambda: clock.now() > 0, 0.1)
        elif node.wait(lambda: node.pass_gate(node.lacking, go_epoch(node.team, clock.now())), 0.5):
            self._is_due = node.wait_for_moment(self._moments(clock.steady()))

    def _moments(self, now: int) -> Rate:
        if self._rate is None:
            # The first moment is now.
            self._rate, self._node.began = Rate(to_ns(self._period), now - to_ns(self._period)), now
        return self._rate

    def take(self) -> int | None:
        """The time of the moment that has come."""
        is_due, self._is_due = self._is_due, False
        return self._node.clock.now() if is_due else None

    def act(self, due: Due) -> Twist | None:
        """Call the user's step from GO on; in the first tick, which comes again with GO, once."""
        if not self._node.pass_gate(self._node.lacking, due.epoch):
            return None
        if due.tick is not None:
            if due.now == self._held[0]:
                return self._held[1]
            if due.tick.tick == 1:
                # Simulated time begins, perhaps again.
                self._rate = None
            if self._moments(due.now).left(due.now):
                return None
            self._moments(due.now).take(due.now)
        # In lock-step the next tick waits for it.
        command = self._watch.run(lambda: self._step(due.now), self._period if due.tick is None else 0.0, paced=True)
        if command is not None and self._node.robot_id is not None:
            command = checked_command(command, f"{self._node.name}: step", self._node.robot_id)
        elif command is not None:
            if self._returned.due():
                name, kind = self._node.name, type(command).__name__
                log.warning("%s: step returned a %s, which nothing takes: put messages on a publisher", name, kind)
            command = None
        if due.tick is not None:
            self._held = due.now if due.tick.epoch == 0 else -1, command
        self._node.report(due, RobotDriver.BEHAVIOR, command)
        return command


class Node(ProcessNode):
    """One process on the bus under a name of its own.

    Call `subscribe` and `publisher`, then `run(step)`, which calls `step(now)` with the time in ns, every `period`
    seconds of simulated time, or of the host's time where there is no simulator. In lock-step each step is that of a
    tick, when all inputs declared with `every_tick` have come for it; the world waits for it.
    """

    _act: Act
    _timer: StepTimer

    def __init__(self, name: str, bus: Bus, stop: Stop, clock: ClockMode = "auto") -> None:
        """Raises UsageError for a name that no process of a user may have."""
        if problem := names.name_problem(name):
            raise UsageError(problem)
        super().__init__(name, bus, stop, clock)
        self._inputs = TickInputs()
        self._messages = TickMessages()
        self._numbers = count()
        self.first_data = 0.0
        """Host time of the first message that may be of a base; 0 before."""
        self.robot_id = names.robot_id_of(name)
        """Of a robot's own process; None of any other."""
        self.switch: StopSwitch | None = None
        """Whether its robot is stopped."""
        self._cmd_vel: Publisher[Twist] | None = None
        if self.robot_id is not None:
            self._cmd_vel = bus.publisher(names.robot_key(self.robot_id, names.CMD_VEL), Twist)
            self.switch = StopSwitch(bus, self.robot_id, self._on_switch, lambda: self.part.expected)
            self.on_present(self.switch.learn)
            # What it has learned may make a step due.
            self.on_present(lambda: self.on_input())
        self.team = TeamStatus()
        """The monitor's newest word, from `follow_go` on."""
        self._heartbeat = Every(HEARTBEAT)
        self.readiness = Readiness(gated=False)
        self.status: StatusReport | None = None
        """Of a robot's own process."""
        self._known_to: tuple[int, ...] = ()
        """Lock-step: the robots that have had its status; none before its own first tick."""
        self.was_run = False
        self._unheard: set[str] = set()
        """What it subscribes to and no message has come of, until it was found what publishes them."""
        self._search = Every(_SEARCH_AFTER)
        self._search.due()
        self.began = math.inf
        """Time (ns) of its first step, or of its last search."""
        self._searching: threading.Thread | None = None
        self.part = Participant(self, self._on_listed, self._on_refused)
        if self.switch is not None and self.robot_id is not None:
            for topic, stopped in STOPS.items():
                self.part.changes[names.robot_key(self.robot_id, topic)] = partial(self._take_stop, stopped)
        bus.serve(names.service_key(name, names.LACKING), NoRequest, lambda _: self._answer_lacking())
        self.on_time_reset(self._forget)

    def _forget(self) -> None:
        self._inputs.forget()
        self._messages = TickMessages()

    def _on_listed(self) -> None:
        """The first tick that lists this process: chance says what others have sent before, but for what is latched."""
        self._messages.forget_others()

    def _on_refused(self, key: str) -> None:
        """A message of a process that takes no part was dropped, and the tick still waits for inputs."""
        if declared := self._inputs.declared_without(key):
            self.fail(
                UsageError(
                    f"{self.name} waits for {declared} in every tick, which comes from a process that takes no part in "
                    "lock-step: subscribe without every_tick, or let that process take part (zteam.Node)"
                )
            )

    def publisher(self, key: str, message_type: type[M], *, latched: bool = False) -> Publisher[M]:
        """A publisher of `message_type` on `key`, closed with the node. With `latched`, a late subscriber gets the last
        message.

        Raises UsageError for a wildcard, and for a type that a key of zteam does not carry.
        """
        if not isinstance(key, str) or names.is_wildcard(key) or len(key.split()) != 1:
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
        callback: Callable[[str, M], object],
        *,
        latched: bool = False,
        every_tick: bool = False,
    ) -> Closeable:
        """Call `callback(key, message)` for each message, never at the same time as `step`: what comes during a step is
        taken after it.

        In lock-step messages of the simulator are handled in their tick, before `step`, and those of other processes in
        the tick after the one in which they were sent (`TickMessages`).
        With `every_tick`, a lock-step's `step` waits for the tick's own message: of the key, or of every robot in the
        world if the key is `robot_$*/topic`. Such a message needs a header with the stamp of its tick; `tf` may be
        waited for as well, which ends with the aggregator.
        """
        what = f"subscribe({key_expr!r}, …): the callback takes the key and the message"
        check_call(callback, 2, f"{what}, as 'def on_message(key, message): …'")
        if every_tick:
            self._inputs.declare(key_expr, message_type)
        call = self._failing(callback)
        self._unheard.add(key_expr)

        def handle(key: str, message: Message, _stamp: int = 0) -> None:
            self._unheard.discard(key_expr)
            # Before there is a simulator come latched messages, such as the aggregator's, and those of processes alone.
            if not (latched or isinstance(message, RobotStatus | NavigationStatus | TeamStatus)):
                self.first_data = self.first_data or monotonic()
            call(key, message)
            if every_tick:
                self._inputs.take(key, stamp_of_tick(message))

        return self.receive(key_expr, message_type, handle, latched=latched, every_tick=every_tick, newest_only=False)

    hear = ProcessNode.subscribe
    """As `subscribe`, but at once in lock-step too, and an error of the callback does not end the process."""

    def receive(
        self,
        key_expr: str,
        message_type: type[M],
        handle: Handle,
        problem: Callable[[RawSample], str] | None = None,
        *,
        latched: bool = False,
        every_tick: bool = False,
        newest_only: bool = True,
    ) -> Closeable:
        """Call `handle(key, message, stamp)` with what others send: in lock-step in the tick after the one in which it
        was sent, whose `stamp` (ns) is given; else at once. `newest_only`: only with each sender's newest message.

        `problem(sample)`, not called under `changed`, says why a sample is dropped; empty if it is not.
        """
        number, simulators = next(self._numbers), frozenset[str]() if newest_only else self.part.ticks.simulators

        def on_message(key: str, message: Message, source: str = "") -> None:
            due, part = stamp_of_tick(message) if every_tick else None, self.part
            if self.is_of_ended_time(lambda: stamp_of_tick(message) if isinstance(message, RobotStatus) else due or 0):
                return
            if part.tick is None:
                self._messages.handle_due(None)
                handle(key, message, self.clock.now())
                return
            arrival = HeldMessage(number, key, message, source, source in simulators, due, handle, newest_only, latched)
            if full := self._messages.take(arrival, part.stamp, is_open=part.state is TickState.OPEN):
                self.bus.counters.drop(key, full)

        return self.bus.subscribe_from(key_expr, message_type, self.handler(on_message), problem, latched=latched)

    def serve_change(
        self,
        key: str,
        request_type: type[Request],
        check: Callable[[Request], tuple[Any, bool]],
        change: Callable[[Request], object],
        *,
        after_step: bool = False,
    ) -> None:
        """Answer queries that change this process. `check(request)` returns the answer and whether `change(request)` is
        to follow: at once, or in lock-step with the next tick, in which it is one of all changes from outside.

        Both are called under `changed`; with `after_step`, not during a step.
        """

        def answer(request: Request) -> Any:
            with self.between_steps() if after_step else self.changed:
                reply, is_accepted = check(request)
                if is_accepted and self.part.expected:
                    self.part.hand_on(key, msgspec.json.encode(request))
                elif is_accepted:
                    change(request)
                return reply

        def handle(request: Request) -> Any:
            # It may wait, and other queries are answered meanwhile.
            return Deferred(partial(answer, request)) if after_step else answer(request)

        self.part.changes[key] = lambda data: change(msgspec.json.decode(data, type=request_type))
        self.bus.serve(key, request_type, handle)

    def hear_stamp(self, stamp: int) -> None:
        """Data of the simulator of time `stamp` (ns) has come, whose tick may be on its way."""
        if self.part.tick is not None:
            self._messages.hear(stamp, self.part.stamp)

    def need(self, lacks: Callable[[Tick], list[str]]) -> None:
        """In lock-step, let `step` wait while `lacks(tick)` names keys; it is asked after each message."""
        self._inputs.need(lacks)

    def watch_tokens(self, key_expr: str, callback: Callable[[str, bool], None]) -> None:
        """Call `callback(key, alive)` for presence tokens, never at the same time as `step`."""
        check_call(callback, 2, f"watch_tokens({key_expr!r}, …): the callback takes the key and whether it is alive")
        super().watch_tokens(key_expr, self._failing(callback))

    def _failing(self, callback: Callable[[str, Any], object]) -> Callable[..., None]:
        """A user's `callback`, whose error ends the process."""

        def handle(key: str, value: Any) -> None:
            try:
                callback(key, value)
            except BaseException as error:
                self.fail(error)

        return handle

    def run(self, step: Step = None, period: float = 0.1, *, gate: bool = False) -> None:  # type: ignore[assignment]
        """Call `step(now)` every `period` seconds until the process is asked to stop, in lock-step in the first tick at
        or after each such moment. Raises what `step` raises.

        With `gate` it calls `step` from the monitor's GO on. A robot's own process (`robot_N`) tells the monitor that
        it is ready when all that it subscribes to with `every_tick` has come.

        `step` must not ask the bus (`bus.ask`, a TransformClient): no answer is taken until it returns.
        """
        check_call(step, 1, f"node.run({step!r:.60}): write node.run(step) with a function 'def step(now): …'")
        if not (isinstance(period, Real) and 0.0 <= period < math.inf):
            raise UsageError(f"node.run(step, period={period!r}): give the seconds between two steps, such as 0.1")
        is_own = self.name == names.GOALS or names.navigated_robot_of(self.name) is not None
        self.was_run, self.claim.info.is_users = True, not is_own
        status, readiness = None, Readiness(gated=gate, way_out="" if self.in_team else "zteam-monitor")
        if gate:
            self.follow_go()
            if self.robot_id is not None and self.switch is not None:
                status = StatusReport(self, self.robot_id, "zteam.Node", readiness, self.switch)
        own = UserStep(self, step, period)
        self.adopt(own.act, own, readiness, status)
        self.become_present()
        when = "in lock-step: in the first tick at or after it"
        waits = ": waiting for the monitor's GO" if gate else ""
        log.info("node %s, a step every %g s (%s)%s", self.name, period, when, waits)
        self.drive(self.look)

    def adopt(
        self, act: Act, timer: StepTimer, readiness: Readiness | None = None, status: StatusReport | None = None
    ) -> None:
        """Let `act` take the steps: in lock-step once the process holds its name, in real time within `drive`."""
        self._act, self._timer, self.status = act, timer, status
        self.readiness = readiness or self.readiness
        self.on_input = self._advance

    def follow_go(self) -> None:
        self.hear(names.TEAM_STATUS, TeamStatus, self._on_team_status, latched=True)

    def _on_team_status(self, _key: str, status: TeamStatus) -> None:
        self.team = status

    def drive(self, beat: Callable[[], None]) -> None:
        """Take steps until the process is asked to stop; call `beat()` once a second. Raises what a step raises."""
        # Only the process that holds the name may publish under it, so not before this.
        self.on_stop(self.halt)
        self.on_stop(lambda: let_end(self._searching))
        while not self.stopping:
            self.decide_clock(self.first_data)
            if self.part.expected:
                # The steps go on in handlers.
                self.wait(lambda: not self.part.expected, self._heartbeat.left(), by_inputs=False)
            else:
                self._timer.wait(self._heartbeat.left())
                self.take_step(self._begin, self._act, self._end)
            if self.stopping or not self._heartbeat.due():
                continue
            beat()
            self._look_for_publishers()
            with self.changed:
                if self.status is not None:
                    self.status.say_again()

    def _look_for_publishers(self) -> None:
        """Once, when a team is there: log which of its keys nothing publishes. A thread waits for the answers."""

        def search() -> None:
            with suppress(BusError):
                graph, unheard = find_graph(self.bus), [*self._unheard]
                found = unpublished(graph, unheard)
                if found is not None and not self.stopping:
                    self._unheard.difference_update(unheard)
                    for key, near in found.items():
                        log.warning("nothing publishes %s%s", key, near)

        # A lock-step that is fast may soon be over, and one that waits for this node stands.
        is_late = self.clock.steady() - self.began >= to_ns(_SEARCH_AFTER)
        if self.claim.info.is_users and self._unheard and (is_late or self._search.due()):
            self.began = self.clock.steady()
            self._searching = threading.Thread(target=search, name="publishers", daemon=True)
            self._searching.start()

    @property
    def is_stopped(self) -> bool:
        """Whether the robot of this process is stopped (`zteam stop`)."""
        return self.switch is not None and self.switch.is_stopped

    def _take_stop(self, stopped: bool, _request: bytes) -> None:
        """A tick tells that the robot is stopped or released."""
        if self.switch is not None:
            self.switch.change(stopped)

    def _on_switch(self) -> None:
        """A query has stopped or released its robot. In real time that waits neither for the next step nor for the end
        of one; in lock-step it counts from the next tick on.
        """
        if self.part.tick is not None:
            return
        with self.changed:
            if self.is_stopped:
                self._command(Twist())
            if self.status is not None:
                self.status.say_again()

    def halt(self) -> None:
        """Publish zero velocity, then the status; both leave before the session closes."""
        if self.robot_id is None:
            return
        with self.changed:
            self._command(Twist())
            if self.status is not None:
                self.status.stop()
        log.info("%s stopped", self.name)

    def lacking(self) -> list[str]:
        """The inputs that are missing: those of the newest tick, or those that never came where there are no ticks."""
        return self._inputs.lacking(self.part.tick)

    def _answer_lacking(self) -> Lacking:
        return Lacking(self._inputs.lacking(self.part.tick) if self.part.state is TickState.OPEN else [])

    def pass_gate(self, lacks: Callable[[], list[str]], epoch: int) -> bool:
        """Whether the steps may begin: `lacks()` names nothing and GO `epoch` holds (0 = none); then for good."""
        was_released = self.readiness.released
        lacking = [] if was_released else lacks()
        with self.lock:
            is_released = self.readiness.take(lacking, epoch)
            if self.status is not None and not was_released:
                # The monitor logs GO, which robots are ready, and what the others lack.
                if is_released:
                    if not self.in_team:
                        log.info("GO: driving")
                elif self.in_team and (self.readiness.is_ready or self.team.state != TeamState.GO):
                    self.status.publish_change()
                else:
                    self.status.tell()
        return is_released

    def look(self) -> None:
        """Find out what is missing before GO: a step that stops at the gate."""
        self.take_step(lambda: None if self.readiness.released else Due(self.clock.now()), self._act)

    def report(self, due: Due, driver: str, command: Twist | None, reason: str = "", *, logged: bool = True) -> None:
        """A step has this command of `driver`, and a `reason` why it is not what was wanted; `logged`: see `tell`."""
        with self.lock:
            self.readiness.drive(reason, due.epoch)
            if self.status is not None and command is not None:
                self.status.driver, self.status.command = driver, command
                self.status.tell(logged=logged)

    # A step: `_begin`, then `_act` without `changed`, then `_end`

    def _advance(self) -> None:
        """Lock-step: take the step of the open tick, if its inputs are there.

        The first tick is held until all are ready, and what that takes may come after the answer.
        """
        state = self.part.state
        if state is TickState.OPEN:
            self.take_step(self._begin, self._act, self._end)
        elif state is TickState.ANSWERED and not self.readiness.released:
            self.look()

    def _begin(self) -> Due | None:
        part, tick, may_step = self.part, self.part.tick, self.switch is None or self.switch.is_known
        if tick is not None:
            if part.state is not TickState.OPEN:
                return None
            self._messages.handle_due(part.stamp, part.screen.sessions)
            # A message that was due may have ended the process.
            if not (self.can_publish and may_step) or self._inputs.lacking(tick):
                return None
            part.begin()
            return Due(part.stamp, tick.epoch, tick, tick.tick == 1 or not self._known_to)
        now = None if part.expected or self.stopping or not may_step else self._timer.take()
        if now is None:
            return None
        self._messages.handle_due(None)
        return Due(now, go_epoch(self.team, now))

    def _end(self, due: Due, command: Twist | None) -> None:
        if command is not None and self.is_stopped:
            # Perhaps during the step.
            command = Twist()
        if due.tick is None:
            self._command(command)
            return
        before, self._known_to = self._known_to, self.part.team
        if self.status is not None:
            if due.is_first or before is not self._known_to:
                # A robot that has just come must know this one from the next tick on, not from a heartbeat by chance.
                self.status.publish()
            self.status.keep_up(due.now)
        self.part.answer(due.tick, command)

    def _command(self, command: Twist | None) -> None:
        if command is not None and self._cmd_vel is not None:
            self._cmd_vel.put(command)


def stepping(body: Callable[[Node], None]) -> Callable[[Node], None]:
    """A user's `body(node)`, with a word to the user if it returned without a step, or if zteam needs its name."""

    def checked(node: Node) -> None:
        if names.is_taken(node.name):
            raise UsageError(f"{node.name} is the name of a process of every team; choose another name")
        body(node)
        if not (node.was_run or node.stopping):
            log.warning("%s: its main has returned without node.run(step), so it took no part in the team", node.name)

    return checked


def run(
    name: str,
    body: Callable[[Node], None] | None = None,
    options: BusOptions | None = None,
    *,
    clock: ClockMode = "auto",
) -> int:
    """Run `body(node)` as the process `name`; the body calls `node.run(step)`. Returns 0 after an orderly stop.

    Raises SystemExit(1) after an error, which it has logged: the script ends with that code, even if it ignores what
    `run` returns.

    Stops in order on SIGINT and SIGTERM; nothing else of the program changes. Without `options` the environment says
    how to reach the bus, as for every command (`ZTEAM_CONNECT`, `ZTEAM_NAMESPACE`, `ZTEAM_CONFIG`, `ZTEAM_LEASE`).
    """
    text = """zteam.run(name, body): write zteam.run("watcher", main) with a function 'def main(node): …'"""
    try:
        check_call(body if isinstance(name, str) else None, 1, text)
    except UsageError as error:
        log.error("%s: %s", place_in(extract_stack()), error)
        raise SystemExit(error.exit_code) from None
    assert body is not None
    chosen = BusOptions.from_environment() if options is None else options
    stop = Stop()
    offer_stacks(name, stop)
    with stop.install():
        code = run_body(name, partial(connect, chosen, stopping=stop), stepping(body), stop, clock, make=Node)
    if code:
        raise SystemExit(code)
    return code
