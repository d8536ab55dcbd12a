"""The robot process: one robot's brain. It cannot tell the simulator from a real base.

It acts when a scan arrives, not on a timer of its own, so that a command follows its scan at once; between scans it
only watches for data that has grown old. In lock-step it acts once a tick, when all its inputs of that tick have come.
"""

import logging
from collections.abc import Callable
from typing import Any

import msgspec

from zteam import names
from zteam.base import BaseOverride
from zteam.behaviors import Behavior
from zteam.clock import Every, monotonic
from zteam.messages import BaseInfo, LaserScan, Odometry, TeamStatus, TFMessage, Tick, Twist, ns_from_time
from zteam.nodes.robot.driver import Driver, Turn
from zteam.nodes.robot.inputs import Inputs
from zteam.nodes.robot.pacing import ScanPacing
from zteam.nodes.robot.parameters import Parameters
from zteam.nodes.robot.readiness import Readiness
from zteam.nodes.robot.status import StatusReport
from zteam.nodes.robot.waiting import Waiting
from zteam.runtime.node import Node
from zteam.runtime.participant import Participant

log = logging.getLogger("zteam")


class RobotOptions(msgspec.Struct, frozen=True):
    """What the command line says about the robot."""

    robot_id: int
    behavior: str
    """Its name."""
    params: dict[str, Any] = {}
    """Of the behaviour, by name."""
    gate: bool = True
    """Wait for the monitor's GO."""
    seed: int = 1
    base: BaseOverride = BaseOverride()
    """What holds instead of `base_info`."""


class RobotNode:
    """One robot on the bus. Handlers of messages run under `node.changed`."""

    def __init__(self, node: Node, kind: type[Behavior], options: RobotOptions) -> None:
        """`kind` is the class of the behaviour, which is made anew after time has jumped back."""
        self._node = node
        self._id = options.robot_id
        self._inputs = Inputs(self._id, options.base)
        self._status = StatusReport(node, self._id, options.behavior, Readiness(gated=options.gate))
        parameters = Parameters(node, kind, options.behavior, options.params)
        self._driver = Driver(node, self._inputs, parameters, self._status, self._id, options.seed)
        self._driver.on_release = self._drop_idle_inputs
        self._first_data = 0.0
        """Host time of the first scan; 0 before."""
        self._heartbeat = Every(1.0)
        self._cmd_vel = node.bus.publisher(self._key(names.CMD_VEL), Twist)
        # First: latched messages come while it subscribes, and look whether this is lock-step.
        self._part = Participant(node, self._has_inputs, self._act)
        self._pacing = ScanPacing(node, self._inputs, self._driver, self._part)
        self._waiting = Waiting(node, self._inputs, self._driver, self._part)
        self._subscribe()

    def _key(self, topic: str) -> str:
        return names.robot_key(self._id, topic)

    def _subscribe(self) -> None:
        node = self._node
        node.clock.sim.on_jump_back(self._on_jump_back)
        node.subscribe(self._key(names.BASE_SCAN), LaserScan, self._on_scan, wake=False)
        node.subscribe(names.TEAM_STATUS, TeamStatus, self._on_team_status, latched=True)
        node.subscribe(self._key(names.BASE_INFO), BaseInfo, self._on_base_info, latched=True)
        self._odom_input = node.subscribe(self._key(names.ODOM), Odometry, self._on_odom, wake=False)
        self._tf_input = node.subscribe_payloads(names.TF, TFMessage, self._on_tf)
        node.subscribe(names.TF_STATIC, TFMessage, self._on_tf_static, latched=True)
        node.watch_tokens(names.tokens_key(names.MONITOR), self._on_monitor)

    def _on_scan(self, _key: str, scan: LaserScan) -> None:
        self._inputs.scan = scan
        self._part.take_stamp(ns_from_time(scan.header.stamp))
        self._first_data = self._first_data or monotonic()
        self._on_input()

    def _on_odom(self, _key: str, odom: Odometry) -> None:
        self._inputs.odom = odom
        if self._part.active:
            self._on_input()

    def _on_team_status(self, _key: str, status: TeamStatus) -> None:
        self._inputs.team = status

    def _on_tf(self, _key: str, payload: bytes) -> None:
        self._inputs.take_bundle(payload)
        self._on_input()

    def _on_tf_static(self, _key: str, message: TFMessage) -> None:
        self._inputs.take_static(message)
        self._on_input()

    def _on_base_info(self, _key: str, message: BaseInfo) -> None:
        self._inputs.base_input.take(message)
        self._on_input()

    def _on_monitor(self, _key: str, alive: bool) -> None:
        if alive:
            # A monitor that has just come must not wait for the next heartbeat to know this robot.
            self._status.publish()

    def _on_jump_back(self, _old: int, _new: int) -> None:
        log.warning("time jumped back (the simulator started anew): old data is forgotten")
        self._inputs.forget()
        self._driver.jump_back()
        self._pacing.acted = 0

    def _on_input(self) -> None:
        """An input has come: lock-step goes on in this very thread, real time in the main loop."""
        driver = self._driver
        if not self._part.active:
            if self._pacing.wakes():
                self._node.changed.notify_all()
        elif not self._part.advance() and not driver.readiness.released and self._node.speaks and not driver.busy:
            # The first tick is held until all are ready, and what that takes may come after this robot's answer.
            with self._node.failing():
                driver.pass_gate(driver.turn(self._pacing.acted, 0))

    def run(self) -> None:
        """Drive until the process is asked to stop."""
        while not self._node.stopping:
            self._node.wait(self._pacing.is_due, 0.1)
            if self._node.stopping:
                return
            self._node.decide_clock(self._first_data)
            self._take_turn(self._pacing.begin_turn, self._driver.step)
            if not self._heartbeat.due():
                continue
            self._waiting.find_absence()
            self._take_turn(self._waiting.begin_look, self._driver.look)
            with self._node.changed:
                self._waiting.tell()
                self._status.publish()

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
        return self._inputs.complete_for(ns_from_time(tick.stamp), tf=tf, connected=not self._driver.readiness.released)

    def _act(self, tick: Tick) -> Twist | None:
        """Lock-step: this tick's command."""
        self._pacing.acted = ns_from_time(tick.stamp)
        turn = self._driver.turn(self._pacing.acted, tick.epoch)
        self._driver.stepped = self._pacing.acted
        return self._driver.step(turn)

    def _drop_idle_inputs(self) -> None:
        """Close the inputs that only the gate needed: every message wakes the process."""
        if not self._driver.behavior.uses_odom:
            self._inputs.needs_odom = False
            self._odom_input.close()
        if not self._driver.behavior.uses_tf:
            self._inputs.needs_tf = False
            self._tf_input.close()

    def halt(self) -> None:
        """Publish zero velocity, then the status; both leave before the session closes."""
        with self._node.changed:
            self._cmd_vel.put(Twist())
            self._driver.readiness.stop()
            self._status.command = None
            self._status.publish()
        log.info("%s stopped", names.robot_name(self._id))


def run_robot(node: Node, kind: type[Behavior], options: RobotOptions) -> None:
    """Be robot `options.robot_id` until asked to stop."""
    robot = RobotNode(node, kind, options)
    node.become_present()
    # Only the process that holds the name may publish commands, so not before this.
    node.on_stop(robot.halt)
    if not options.gate:
        log.info("not waiting for GO (--no-gate)")
    robot.run()
