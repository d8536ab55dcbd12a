"""The robot process: one robot's brain. It cannot tell the simulator from a real base.

It acts when a scan arrives, not on a timer of its own, so that a command follows its scan at once; between scans it
only watches for data that has grown old. In lock-step it acts once a tick, when all its inputs of that tick have come.
"""

import logging
from collections.abc import Callable

from zteam import names
from zteam.behaviors import Behavior
from zteam.behaviors.behavior import declared_inputs
from zteam.clock import Every
from zteam.messages import Tick, Twist
from zteam.nodes.robot.alive import AliveRobots
from zteam.nodes.robot.driver import Driver, Turn
from zteam.nodes.robot.inputs import Inputs
from zteam.nodes.robot.pacing import ScanPacing
from zteam.nodes.robot.parameters import Parameters
from zteam.nodes.robot.subscriptions import Subscriptions
from zteam.nodes.robot.waiting import Waiting
from zteam.process_options import RobotOptions
from zteam.runtime.lockstep import Participant
from zteam.runtime.process_node import ProcessNode
from zteam.runtime.robot_status import Readiness, StatusReport
from zteam.services.navigation import CANCEL, CancelReply, CancelRequest, navigation_query

log = logging.getLogger("zteam")

_HEARTBEAT = 1.0
"""Host seconds after which a robot gives a sign of life."""
_LOOK = 0.1
"""Host seconds between two looks at whether data has stopped, in real time."""


class RobotNode:
    """One robot on the bus. Handlers of messages run under `node.changed`."""

    def __init__(self, node: ProcessNode, kind: type[Behavior], options: RobotOptions) -> None:
        """`kind` is the class of the behaviour, which is made anew after time has jumped back."""
        self._node = node
        self._id = options.robot_id
        self._inputs = Inputs(self._id, options.base, declared_inputs(kind.inputs, self._id))
        readiness = Readiness(gated=options.gate)
        self._status = StatusReport(
            node, self._id, options.behavior, readiness, lambda: self._part.active, safety=options.safety
        )
        parameters = Parameters(node, kind, options.behavior, options.params)
        self._driver = Driver(
            node, self._inputs, parameters, self._status, self._id, options.seed, self._team, safety=options.safety
        )
        self._heartbeat = Every(_HEARTBEAT)
        self._known_to: tuple[int, ...] = ()
        """Lock-step: the robots that have had its status; none before its own first tick."""
        self._cmd_vel = node.bus.publisher(names.robot_key(self._id, names.CMD_VEL), Twist)
        # First: latched messages come while it subscribes, and look whether this is lock-step.
        self._part = Participant(node, self._has_inputs, self._act, gives_away=True)
        self._alive = AliveRobots(node)
        self._pacing = ScanPacing(node, self._inputs, self._driver, self._part)
        self._waiting = Waiting(node, self._inputs, self._driver, self._part)
        node.clock.sim.on_jump_back(self._on_jump_back)
        if self._status.navigation is not None:
            node.bus.serve(navigation_query(self._id, CANCEL), CancelRequest, self._cancel_goal)
        self._subscriptions = Subscriptions(node, self._id, self._inputs, self._part, self._on_input)

    def _cancel_goal(self, _request: CancelRequest) -> CancelReply:
        with self._node.changed:
            return CancelReply(self._driver.behavior.cancel_goal())

    def _team(self) -> tuple[int, ...]:
        """The robots that are alive: in lock-step those that take part in the tick, so that all robots see the same."""
        return self._part.team if self._part.active else self._alive.ids()

    def _on_jump_back(self, _old: int, _new: int) -> None:
        log.warning("time jumped back (the simulator started anew): old data is forgotten")
        self._inputs.forget()
        self._driver.jump_back()
        self._pacing.acted = 0

    def _on_input(self) -> None:
        """An input has come: lock-step goes on in this very thread, real time in the main loop."""
        driver, part = self._driver, self._part
        if part.active and not (part.advance() or driver.readiness.released or driver.busy) and self._node.speaks:
            # The first tick is held until all are ready, and what that takes may come after this robot's answer.
            try:
                driver.pass_gate(driver.turn(self._pacing.acted, 0))
            except BaseException as error:
                self._node.fail(error)

    def run(self) -> None:
        """Drive until the process is asked to stop."""
        while not self._node.stopping:
            self._wait_for_work()
            if self._node.stopping:
                return
            self._node.decide_clock(self._subscriptions.first_data)
            self._take_turn(self._pacing.begin_turn, self._driver.step)
            if not self._heartbeat.due():
                continue
            self._waiting.find_absence()
            self._take_turn(self._waiting.begin_look, self._driver.look)
            with self._node.changed:
                self._waiting.tell()
                self._status.beat()

    def _wait_for_work(self) -> None:
        """Wait until a turn is due in real time. In lock-step, which goes on in handlers, only heartbeats are due."""
        part, active = self._part, self._part.active
        due = self._heartbeat.left()
        self._node.wait(lambda: part.active != active or self._pacing.is_due(), due if active else min(due, _LOOK))

    def _take_turn(self, begin: Callable[[], Turn | None], step: Callable[[Turn], Twist | None]) -> None:
        """Real time: take the turn that is due. The behaviour is asked without `node.changed`."""
        with self._node.changed:
            turn = begin()
            if turn is None:
                return
            self._driver.busy = True
        command = step(turn)
        with self._node.changed:
            self._driver.busy = False
            if self._part.active:
                # Lock-step began during the step; the tick has waited for its end.
                self._part.advance()
            elif command is not None and turn.jumps == self._driver.jumps:
                self._cmd_vel.put(command)

    def _has_inputs(self, tick: Tick) -> bool:
        """Lock-step: whether the tick can be answered: all that it brings to this robot has come."""
        if self._driver.busy:
            return False
        if self._id not in self._part.robots:
            return True
        # Without an aggregator among the participants no transforms of this tick are promised. A bundle of lock-step is
        # whole; only at first the fixed transforms may still be on their way.
        tf = names.AGGREGATOR in tick.participants
        return self._inputs.has_bases(self._part.robots) and self._inputs.complete_for(
            self._part.stamp, tf=tf, connected=not self._driver.readiness.released
        )

    def _act(self, tick: Tick) -> Twist | None:
        """Lock-step: this tick's command."""
        self._pacing.acted = self._part.stamp
        is_first = tick.tick == 1 or not self._known_to
        turn = self._driver.turn(self._pacing.acted, tick.epoch, is_first=is_first)
        self._driver.stepped = self._pacing.acted
        command = self._driver.step(turn)
        if is_first or self._part.team != self._known_to:
            # A robot that has just come must know this one from the next tick on, and not from a heartbeat by chance.
            self._known_to = self._part.team
            self._status.publish()
        self._status.keep_up(self._pacing.acted)
        return command

    def halt(self) -> None:
        """Publish zero velocity, then the status; both leave before the session closes."""
        with self._node.changed:
            self._cmd_vel.put(Twist())
            self._status.stop()
        log.info("%s stopped", names.robot_name(self._id))


def run_robot(node: ProcessNode, kind: type[Behavior], options: RobotOptions) -> None:
    """Be robot `options.robot_id` until asked to stop."""
    robot = RobotNode(node, kind, options)
    node.become_present()
    # Only the process that holds the name may publish commands, so not before this.
    node.on_stop(robot.halt)
    if not options.safety:
        log.warning("NO SAFETY LAYER (--no-safety): nothing stops this robot before obstacles or on old data")
    if not options.gate:
        log.info("not waiting for GO (--no-gate)")
    robot.run()
