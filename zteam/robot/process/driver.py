"""The robot's steps: gate, behaviour, velocity mux, safety layer, status. The same in real time and in lock-step."""

from collections.abc import Callable
from functools import partial
from typing import Any

from zteam import names
from zteam.bus import NoRequest
from zteam.clock import FREEZES, monotonic, to_ns
from zteam.errors import UsageError, log
from zteam.messages import RobotDriver, Twist
from zteam.node.node import Node
from zteam.node.process_options import RobotOptions
from zteam.node.robot_status import StatusReport
from zteam.node.steps import Due
from zteam.node.stopping import STOPPED
from zteam.node.working import Pauses, StepWatch
from zteam.reasons import Reason
from zteam.robot.behaviors.behavior import Behavior, ask_for_step, missing, old_data
from zteam.robot.behaviors.registry import read_params
from zteam.robot.client import DESCRIBE, SET, DescribeReply, SetReply, SetRequest
from zteam.robot.parameters import parameters_of, values_of
from zteam.robot.process.inputs import RobotInputs
from zteam.robot.safety.layer import SafetyLayer
from zteam.robot.safety.motion import limit_speed
from zteam.robot.view import View

FREE_AFTER = to_ns(1.0)
"""Simulated ns that the way has to be free before the log says so: at the edge of a stop it comes and goes."""
ALONE = "no data from its base (no simulator: zteam-sim WORLD)"


class SafetyLog:
    """Logs once when the safety layer stops or slows the robot, and once when the way is free again."""

    def __init__(self, behavior: str) -> None:
        """`behavior` is the name that the lines show of it."""
        self._behavior = behavior
        self.stops = 0
        """How often a stop has begun."""
        self._began = self._free = 0
        """Time of the stop, and since when the robot may drive again (ns); 0: there is none."""
        self._stands = False
        """Whether a line has said that it was stopped, and not only slowed."""

    def note(self, driver: str, wanted: Twist, trouble: str, now: int) -> None:
        """At time `now` (ns) `driver` wanted a velocity; `trouble` says why that was stopped, empty if it was not."""
        if trouble:
            self._free, stands = 0, not Reason.of(trouble).slows
            if not self._began or (stands and not self._stands):
                self.stops += not self._began
                self._began, self._stands = self._began or now, stands
                wanting = self._behavior if driver == RobotDriver.BEHAVIOR else driver
                speed = wanted.linear.x or wanted.linear.y
                slows = "backs up" if wanted.linear.x < 0.0 else "drives" if speed else "turns"
                done = f"stopped {wanting} ({speed:.2f} m/s)" if stands else f"{wanting} {slows} slowly"
                log.info("safety: %s: %s", done, trouble)
        elif self._began and wanted.linear.x:
            self._free = self._free or now
            if now - self._free >= FREE_AFTER:
                log.info("safety: the way is free again after %.1f s", (self._free - self._began) / 1e9)
                self._began, self._free, self._stands = 0, 0, False


class Driver:
    """Asks the behaviour of a robot, has its status told, and answers the queries of its parameters.

    The node calls `step` without `node.changed`: nothing that it goes by changes meanwhile. Parameters that are set
    count from the next step on, so no step sees them change.
    """

    def __init__(
        self,
        node: Node,
        inputs: RobotInputs,
        kind: type[Behavior],
        status: StatusReport,
        options: RobotOptions,
        team: Callable[[], tuple[int, ...]],
    ) -> None:
        """`kind` is the class of the behaviour; `team()`: ids of the robots that are alive."""
        self._node, self._team, self._inputs, self._kind, self.status = node, team, inputs, kind, status
        self._id, self._seed, self._has_layer = options.robot_id, options.seed, options.safety
        self._parameters = options.params
        """Those that were given at the start or set since: never changed, only replaced (under `node.changed`). They
        outlast a jump back in time."""
        self._asked = options.params
        """With those that were asked for, and that a tick of lock-step has still to carry."""
        self._make_behavior(self._parameters)
        self._watch = StepWatch(f"{kind.__name__}.step", "a scan comes every", f"try zteam check {status.behavior}")
        self.absence = ""
        """Why no scan comes; empty if nothing is known of that."""
        self.is_alone = False
        """Whether no simulator answers."""
        self._stepped = 0
        """Time of the last step (ns); 0 before the first one, and after time has jumped back."""
        self._rested, self._pauses = False, Pauses()
        """Whether the behaviour was not asked in the last step: the robot was stopped, or its data old."""
        self._heard_from = 0.0
        """Real time: the host time from which on there was no pause."""
        node.bus.serve(names.service_key(node.name, DESCRIBE), NoRequest, lambda _: self._describe())
        node.serve_change(names.service_key(node.name, SET), SetRequest, self._check, self._set)

    def _read(self, parameters: dict[str, Any]) -> Any:
        """These parameters as the behaviour's `Params`, for the behaviour alone. Raises UsageError."""
        return read_params(self.status.behavior, self._kind, parameters, self._id)

    def _describe(self) -> DescribeReply:
        values = values_of(self._read(self._asked))
        return DescribeReply(self.status.behavior, parameters_of(self._kind.Params), values)

    def _check(self, request: SetRequest) -> tuple[SetReply, bool]:
        """Whether the behaviour takes these parameters, beside those that hold or are about to."""
        before, name = values_of(self._read(self._asked)), self.status.behavior
        given = {**self._asked, **request.parameters}
        try:
            values = values_of(self._read(given))
            unknown = [key for key in request.parameters if key not in values]
            if unknown:
                # `Params` lacks it and does not forbid it: at the start it is ignored.
                takes = ", ".join(values) or "no parameters"
                raise UsageError(f"behaviour {name}: {unknown[0]}: unknown key; {name} takes {takes}")
        except UsageError as error:
            return SetReply(before, refused=str(error)), False
        self._asked = given
        for key in request.parameters:
            log.info("parameter %s is %r, was %r", key, values[key], before[key])
        return SetReply(values), True

    def _set(self, request: SetRequest) -> None:
        self._parameters = {**self._parameters, **request.parameters}

    def _make_behavior(self, parameters: dict[str, Any]) -> None:
        self.behavior = self.status.tells_of = self._kind(self._read(parameters))
        self._given: dict[str, Any] | None = parameters
        """The parameters that the behaviour has; None: time has jumped back, and it is to be made anew."""
        self._layer, self.safety = SafetyLayer(), SafetyLog(self.status.behavior)

    def begin_anew(self) -> None:
        """Time jumped back (under `node.changed`): the next step makes the behaviour anew."""
        self._given, self._stepped = None, 0

    def step(self, due: Due) -> Twist | None:
        """The command of the step that is `due`; None while the gate is shut."""
        view = self._look(due)
        self._prepare_behavior()
        if not self._node.pass_gate(partial(self._lacking, view), due.epoch):
            return None
        driver, chosen = (not due.is_first and self._inputs.choose(due.now)) or (RobotDriver.BEHAVIOR, None)
        if self._node.is_stopped:
            # Its behaviour is not asked.
            self._rested = True
            self._layer.halt(view)
            return self._note(due, driver, Twist(), STOPPED, logged=False)
        wanted, reason = Twist(), old_data(self.behavior, view)
        rests = bool(reason)
        if self._rested and not rests:
            self.behavior.on_release()
        self._rested = rests
        if not rests:
            # In lock-step the next scan waits.
            asking = partial(ask_for_step, self.behavior, view)
            wanted, reason = self._watch.run(asking, self._inputs.scan_interval, paced=due.tick is None)
        if chosen is not None:
            wanted, reason = chosen, ""
        if self._has_layer:
            command, trouble = self._layer.limit(wanted, view, reason)
        else:
            command, trouble = limit_speed(wanted, view.base)
        # A behaviour that old data keeps from wanting anything is not stopped.
        is_stopped = bool(trouble) and not (rests and chosen is None)
        if is_stopped or not trouble:
            self.safety.note(driver, wanted, trouble, due.now)
        reason = trouble or reason
        # What the safety layer stops has lines of its own.
        return self._note(due, driver, command, reason and (self.absence or reason), logged=not is_stopped)

    def _look(self, due: Due) -> View:
        """The newest data. In the first tick of lock-step nothing counts that others sent: chance says what came before
        it."""
        now, inputs, in_lockstep = due.now, self._inputs, self._node.ticks_tell_time
        dt = (now - self._stepped) / 1e9 if 0 < self._stepped < now else 0.0
        if self._pauses.take(now, inputs.scan_interval, in_lockstep=in_lockstep) and dt:
            # The base has stood meanwhile.
            dt, self._rested = 0.0, True
            self._layer.note_standing()
        if not in_lockstep and self._rested:
            self._heard_from = monotonic()
        heard_from = 0.0 if in_lockstep else max(self._heard_from, FREEZES.look())
        silent = inputs.silent(now if in_lockstep else None, heard_from)
        robots = None if due.tick is None else self._node.part.robots
        return inputs.view(now, dt, self._team(), self._seed, is_first=due.is_first, silent=silent, robots=robots)

    def _note(self, due: Due, driver: str, command: Twist, reason: str, *, logged: bool) -> Twist:
        """Report a step, with the reason why it does not do what was wanted; its command."""
        self._stepped = due.now
        self._node.report(due, driver, command, reason, logged=logged)
        return command

    def _prepare_behavior(self) -> None:
        """Make the behaviour anew if time has jumped back; give it the parameters that were set since its last step."""
        parameters = self._parameters
        if self._given is parameters:
            return
        if self._given is None:
            self._make_behavior(parameters)
        else:
            self.behavior.params, self._given = self._read(parameters), parameters
            self.behavior.on_params()
        with self._node.changed:
            self.status.publish()

    def _lacking(self, view: View) -> list[str]:
        has_none = view.scan is None and not view.scan_needs
        why = ALONE if self.is_alone and has_none and view.odom is None else self.absence
        is_absent = has_none and bool(self.absence)
        lacking = ["its first scan"] if is_absent else missing(view, self.behavior) + self._inputs.missing()
        if why and lacking:
            lacking[-1] += f": {why}"
        return lacking
