"""The monitor process: the start gate and the team's health, shown to a user or as JSON lines."""

import logging
from contextlib import nullcontext

from zteam import names
from zteam.config.numbers import counted
from zteam.config.robot_ids import format_robot_ids
from zteam.messages import TeamStatus, Tick, ns_from_time
from zteam.monitor.process.display import TeamDisplay, showing
from zteam.monitor.process.start_gate import Gate
from zteam.monitor.process.table import Lines
from zteam.monitor.process.view import run_view
from zteam.monitor.process.watch import TeamWatch
from zteam.node.lockstep import Ticks
from zteam.node.process_node import ProcessNode
from zteam.node.process_options import MonitorOptions
from zteam.simulator.client import find_status

log = logging.getLogger("zteam")


class Monitor:
    """The gate on the bus. Callbacks run under `node.changed`."""

    def __init__(self, node: ProcessNode, options: MonitorOptions) -> None:
        self._node = node
        self._options = options
        self.gate = Gate(options.ids, options.team_size)
        self._published: TeamStatus | None = None
        self._publisher = node.bus.publisher(names.TEAM_STATUS, TeamStatus, latched=True)
        self._ticks = Ticks(node, self._on_tick)
        node.follow_clock()
        self._ticks.listen()
        node.clock.on_jump_back(lambda _old, new: self.gate.renew(new))
        self.watch = TeamWatch(node, self.gate)

    def _on_tick(self, tick: Tick) -> None:
        """In lock-step GO holds from the tick that carries it: neither time nor further ticks are needed."""
        self._node.take_time_from_ticks()
        self._node.set_time(ns_from_time(tick.stamp))
        self._ticks.deafen()

    def run(self, output: Lines) -> None:
        """Gate and watch until the process is asked to stop, or until GO with `exit_on_go`."""
        TeamDisplay(self._node, self.gate, self.watch, self._options, output).run(self._decide, self._is_complete)

    def _decide(self) -> None:
        if self.watch.simulator_came and (self.gate.expected is None or self._options.in_world):
            self._learn_ids()
        with self._node.changed:
            if self._is_complete():
                # Where ready robots have come and no simulator, time is wall time.
                self._node.clock.use_wall()
                self.gate.try_go(self._node.clock.now())
            self._publish()

    def _is_complete(self) -> bool:
        return self._node.link_up and not self.gate.gone and len(self.gate.ready) >= self.gate.team_size

    def _learn_ids(self) -> None:
        """Wait for the simulator's own robots if there are as many as asked for, or for those asked for that it has."""
        self.watch.simulator_came = False
        status = find_status(self._node.bus)
        if status is None:
            # Perhaps it is busy. Where GO waits for ids, it waits for robots that the world does not have.
            self.watch.simulator_came = self._options.in_world
            return
        ids = status.robots
        if self._options.in_world:
            ids = [robot_id for robot_id in self._options.ids or () if robot_id in ids]
        if ids and (self._options.in_world or len(ids) == self.gate.team_size):
            with self._node.changed:
                self.gate.expect(ids)

    def _publish(self) -> None:
        status = self.gate.status(self._node.clock.now())
        known = self._published
        if known is not None:
            status.header = known.header
        if status != known:
            self._published = status
            self._publisher.put(status)


def describe_team(options: MonitorOptions) -> str:
    """The robots that GO waits for, in words."""
    if options.ids is None:
        return counted(options.team_size, "robot")
    return f"robot{'s' * (len(options.ids) > 1)} {format_robot_ids(options.ids)}"


def run_monitor(node: ProcessNode, options: MonitorOptions, lines: Lines | None = None) -> None:
    """Be the monitor until asked to stop, or until GO with `exit_on_go`; `lines` instead of standard output.

    Where a monitor runs already, or with a team size of 0, show the running one's team.
    """
    if options.team_size == 0 or node.claim.is_taken():
        run_view(node, options)
        return
    # Before the name is shown: robots publish their status when they see it.
    monitor = Monitor(node, options)
    node.become_present()
    log.info("start gate: waiting for %s, then GO", describe_team(options))
    with nullcontext(lines) if lines else showing(options) as output:
        monitor.run(output)
