"""The robot's steps: gate, behaviour, velocity mux, safety layer, status. The same in real time and in lock-step."""

import logging
from collections.abc import Callable
from functools import partial
from typing import Any

import msgspec

from zteam.behaviors import SafetyLayer, View, missing
from zteam.behaviors.safety import LimitsOnly, ask
from zteam.messages import RobotDriver, Twist
from zteam.nodes.robot.inputs import Inputs
from zteam.nodes.robot.lookups import watch_steps
from zteam.nodes.robot.mux import Choice
from zteam.nodes.robot.parameters import Parameters
from zteam.nodes.robot.safety_log import SafetyLog
from zteam.runtime.process_node import ProcessNode
from zteam.runtime.robot_status import StatusReport

log = logging.getLogger("zteam")


class Turn(msgspec.Struct, frozen=True):
    """What one step goes by."""

    view: View
    choice: Choice | None
    """What drives instead of the behaviour."""
    epoch: int
    """The GO that holds, 0 = none."""
    jumps: int
    """How often time had jumped back when the turn began."""
    given: dict[str, Any]
    """The behaviour's parameters, as in `Parameters`."""
    missing: list[str]
    """What the robot lacks before it is released that its view does not show, as nouns."""


ALONE = "no simulator runs yet (zteam-sim WORLD), and no base sends data"


class Driver:
    """Asks the behaviour of a robot, and has its status told.

    One thread at a time steps: the main loop in real time, and then without `node.changed`, so that a behaviour that
    works long keeps no message waiting; the bus's thread in lock-step, with that lock. `busy` says that a step is under
    way. A jump back in time is only marked. The next step makes the behaviour anew, and what a step of the old time
    found out is dropped.
    """

    is_alone = False
    """Whether no simulator answers."""

    def __init__(
        self,
        node: ProcessNode,
        inputs: Inputs,
        parameters: Parameters,
        status: StatusReport,
        robot_id: int,
        seed: int,
        team: Callable[[], tuple[int, ...]],
        *,
        safety: bool = True,
    ) -> None:
        """`team()`: ids of the robots that are alive, asked under `node.changed`. Without `safety` only limits hold."""
        self._node = node
        self._team = team
        self._inputs = inputs
        self._parameters = parameters
        self._given = parameters.given
        """The parameters that the behaviour has."""
        self.behavior = parameters.make_behavior(self._given)
        self.status = status
        self._tell_place()
        status.rest = lambda: self.behavior.why_it_rests()
        self.readiness = status.readiness
        self.robot_id = robot_id
        self._seed = seed
        self._make_layer: type[SafetyLayer | LimitsOnly] = SafetyLayer if safety else LimitsOnly
        self._layer = self._make_layer()
        self._safety = SafetyLog(status.behavior)
        self._watch = watch_steps(self.behavior, status.behavior, inputs)
        self.absence = ""
        """Why no scan comes; empty if nothing is known of that."""
        self.busy = False
        """Whether the main loop steps: no other thread may (read it under `node.changed`)."""
        self.jumps = 0
        """How often time has jumped back."""
        self._made_at = 0
        """`jumps` when the behaviour was made."""
        self.stepped = 0
        """Time of the last step in ns."""

    def jump_back(self) -> None:
        """Time jumped back (under `node.changed`)."""
        self.jumps += 1
        self.stepped = 0

    def turn(self, now: int, epoch: int, *, is_first: bool = False) -> Turn:
        """A turn at time `now` (ns) with the newest data (under `node.changed`).

        In its first tick of lock-step (`is_first`) nothing counts that others sent: chance says what came before it.
        """
        dt = (now - self.stepped) / 1e9 if 0 < self.stepped < now else 0.0
        inputs = self._inputs
        view = inputs.view(now, dt, self._team(), self._seed, is_first=is_first)
        lacking = [] if self.readiness.released else inputs.base_input.missing()
        choice = None if is_first else inputs.mux.choose(now)
        return Turn(view, choice, epoch, self.jumps, self._parameters.given, lacking)

    def step(self, turn: Turn) -> Twist | None:
        """The command of this turn; None while the gate is shut, or if time jumped back meanwhile."""
        # Mostly the gate was passed long ago, and there is nothing to prepare.
        if not (self.readiness.released and self._is_prepared(turn)) and not self.pass_gate(turn):
            return None
        # In lock-step, where the main loop does not step, the next scan waits.
        asking = partial(ask, self.behavior, turn.view)
        wanted, reason = self._watch.run(asking, self._inputs.scan_interval, paced=self.busy)
        driver = RobotDriver.BEHAVIOR
        if turn.choice is not None:
            driver, wanted, reason = *turn.choice, ""
        command, trouble = self._layer.limit(wanted, turn.view, reason)
        # A behaviour that old data keeps from wanting anything is not stopped.
        if not trouble or trouble != reason:
            self._safety.take(driver, wanted, trouble, turn.view)
        reason = trouble or reason
        if reason:
            reason = self.absence or reason
        with self._node.lock:
            if turn.jumps != self.jumps:
                return None
            self.readiness.drive(reason, turn.epoch)
            self._tell_place()
            self.status.take(driver, command)
            # What the safety layer stops has lines of its own.
            self.status.tell(logged=not self._safety.stopped_at(turn.view.now))
        return command

    def _tell_place(self) -> None:
        """What the behaviour says of its place in a line."""
        behavior, status = self.behavior, self.status
        status.leader, status.follows = behavior.leader, behavior.follows
        status.turns, status.gap, status.navigation = behavior.turns, behavior.gap, behavior.navigation

    def look(self, turn: Turn) -> None:
        """Say what the robot waits for, without a step."""
        self.pass_gate(turn)

    def pass_gate(self, turn: Turn) -> bool:
        """Whether the robot may drive: when nothing is missing and GO has come, and from then on for good."""
        self._prepare_behavior(turn)
        was_released = self.readiness.released
        lacking = [] if was_released else self._lacking(turn)
        with self._node.lock:
            if turn.jumps != self.jumps:
                return False
            if not self.readiness.take(lacking, turn.epoch):
                self.status.tell()
                return False
            if not was_released:
                log.info("GO: driving")
        return True

    def _is_prepared(self, turn: Turn) -> bool:
        """Whether the behaviour is of the turn's time, and has its parameters."""
        return self._made_at == turn.jumps and self._given is turn.given

    def _prepare_behavior(self, turn: Turn) -> None:
        """Make the behaviour anew if time has jumped back; give it the parameters that were set since its last step."""
        if self._made_at != turn.jumps:
            self.behavior = self._parameters.make_behavior(turn.given)
            self._safety, self._layer = SafetyLog(self.status.behavior), self._make_layer()
        elif self._given is not turn.given:
            self.behavior.params = self._parameters.read(turn.given)
            self.behavior.on_params()
        else:
            return
        self._made_at, self._given = turn.jumps, turn.given
        with self._node.changed:
            self._tell_place()
            self.status.publish()

    def _lacking(self, turn: Turn) -> list[str]:
        if self.absence and turn.view.scan is None:
            return [f"its first scan: {self.absence}"]
        lacking = missing(turn.view, self.behavior) + turn.missing
        if self.is_alone and turn.view.scan is None:
            lacking[-1] += f": {ALONE}"
        return lacking
