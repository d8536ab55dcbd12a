"""The monitor process: the start gate and the team's health, shown to a user or as JSON lines."""

import math
from contextlib import nullcontext

import msgspec

from zteam import names
from zteam.bus.presence import ProcessInfo, find_processes
from zteam.clock import monotonic
from zteam.config.numbers import counted
from zteam.config.robot_ids import format_robot_ids
from zteam.errors import UsageError, log
from zteam.messages import TeamStatus, Tick, ns_from_time
from zteam.monitor.process.display import Lines, TeamDisplay, showing
from zteam.monitor.process.start_gate import FollowedTeam, Gate
from zteam.monitor.process.watch import TeamWatch
from zteam.node.lockstep import Ticks
from zteam.node.process_node import ProcessNode
from zteam.node.process_options import MonitorOptions
from zteam.simulator.client import find_status


class Monitor:
    """The gate on the bus. Callbacks run under `node.changed`."""

    def __init__(self, node: ProcessNode, options: MonitorOptions) -> None:
        self._node, self._options = node, options
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
        status, known = self.gate.status(self._node.clock.now()), self._published
        if known is not None:
            status.header = known.header
        if status != known:
            self._published = status
            self._publisher.put(status)


LOOK_FOR = 1.0
"""Host seconds in which a running monitor has to answer, and then to say what it waits for."""


def _find_monitor(node: ProcessNode) -> ProcessInfo | None:
    end = monotonic() + LOOK_FOR
    while not node.stopping and monotonic() < end:
        if answers := find_processes(node.bus, names.MONITOR, timeout=LOOK_FOR):
            return answers[0]
        # A session that was just opened may not reach the other processes yet.
        node.wait(lambda: False, 0.1)
    return None


def run_view(node: ProcessNode, options: MonitorOptions) -> None:
    """Show the running monitor's team. Raises UsageError if none runs."""
    # It answers no query as the monitor, and its log is not the monitor's.
    node.claim.release()
    info = _find_monitor(node)
    if info is None:
        raise UsageError(
            "no monitor is running: give the number of robots to wait for (--team-size 4) or their ids (--ids 0 1 2 3)"
        )
    log.info(
        "a monitor is running already (process %d on %s, for %.0f s): this shows its team; Ctrl+C ends this view only",
        info.pid, info.host, info.age,
    )  # fmt: skip
    if options.table is None and not options.exit_on_go:
        # Where there is no terminal the table is shown at least once: it is what was asked for.
        options = msgspec.structs.replace(options, table=math.inf)
    team = FollowedTeam()
    watch = TeamWatch(node, team)
    watch.on(names.TEAM_STATUS, lambda _key, status: team.on_team(status))
    with showing(options) as output:
        # A table without the running monitor's robots would say nothing.
        node.wait(lambda: team.newest is not None, LOOK_FOR)
        TeamDisplay(node, team, watch, options, output).run()


def run_monitor(node: ProcessNode, options: MonitorOptions, lines: Lines | None = None) -> None:
    """Be the monitor until asked to stop, or until GO with `exit_on_go`; `lines` instead of standard output.

    Where a monitor runs already, or with a team size of 0, show the running one's team.
    """
    if (options.team_size == 0 and options.ids is None) or node.claim.is_taken():
        run_view(node, options)
        return
    # Before the name is shown: robots publish their status when they see it.
    monitor = Monitor(node, options)
    node.become_present()
    if not node.in_team:
        size, ids = options.team_size, options.ids
        awaited = f"robot{'s' * (len(ids) > 1)} {format_robot_ids(ids)}" if ids is not None else counted(size, "robot")
        log.info("start gate: waiting for %s, then GO", awaited)
    with nullcontext(lines) if lines else showing(options) as output:
        monitor.run(output)
