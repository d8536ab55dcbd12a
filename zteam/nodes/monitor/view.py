"""A view of a monitor that runs already: its table and its GO, without a gate of its own."""

import logging
import math
from collections.abc import Sequence

import msgspec

from zteam import names
from zteam.bus.presence import ProcessInfo
from zteam.clock import monotonic, wall_ns
from zteam.errors import BusError, UsageError
from zteam.messages import RobotStatus, TeamState, TeamStatus
from zteam.nodes.monitor.display import Display, Output, showing
from zteam.nodes.monitor.members import Members
from zteam.nodes.monitor.watch import TeamWatch
from zteam.numbers import counted
from zteam.process_options import MonitorOptions
from zteam.robot_ids import format_robot_ids
from zteam.runtime.process_node import ProcessNode


class FollowedTeam:
    """GO, and what it waits for, are the running monitor's; robots and their processes are seen directly."""

    def __init__(self) -> None:
        self.members = Members()
        self.status: TeamStatus | None = None
        """What the running monitor said last."""

    @property
    def gone(self) -> bool:
        """Whether GO is out."""
        return self.status is not None and self.status.state == TeamState.GO

    @property
    def ids(self) -> list[int]:
        """The robots that the running monitor waits for, as far as it names them."""
        return [] if self.status is None else sorted({*self.status.ready.tolist(), *self.status.missing.tolist()})

    def take_token(self, robot_id: int, instance: str, alive: bool) -> None:
        """A process took or lost the name `robot_N`."""
        self.members.take_token(robot_id, instance, alive, late=self.gone)

    def take_status(self, robot_id: int, status: RobotStatus, now: float) -> bool:
        """A robot's status, heard at host time `now` on its own key; False if it speaks for another robot."""
        if status.robot_id != robot_id:
            return False
        self.members.take_status(robot_id, status, now)
        return True

    def take_world(self, robots: Sequence[int] | None) -> None:
        """The running monitor says which robots the world lacks."""

    def take_team(self, status: TeamStatus) -> None:
        """What the running monitor says."""
        was_gone, was_known, self.status = self.gone, self.status is not None, status
        for robot_id in self.ids:
            self.members.get(robot_id)
        if self.gone and was_known and not was_gone:
            self.members.tell("go", None, "All robots GO!")
        else:
            self.members.tell("status", None, self._in_words(status))

    def _in_words(self, status: TeamStatus) -> str:
        ready = f"{status.ready.size} of {status.team_size} ready"
        return f"GO is out; {ready}" if self.gone else f"{ready}; waiting for {self.waiting_for()}"

    def all_running(self) -> bool:
        """Whether every robot that counts obeys the standing GO, or is gone."""
        if self.status is None or not self.gone:
            return False
        epoch = self.status.epoch
        there = [member for member in map(self.members.get, self.ids) if member.alive]
        return all(member.status is not None and member.status.epoch >= epoch for member in there)

    def waiting_for(self) -> str:
        """What GO waits for, in words."""
        status = self.status
        if status is None:
            return "the running monitor"
        # A monitor that is not of zteam may leave the reasons out.
        return status.waiting_for or ", ".join(map(names.robot_name, status.missing.tolist()))

    def differs_from(self, team_size: int, ids: Sequence[int] | None) -> str:
        """How the running monitor's team differs from the one asked for; empty if it does not."""
        if self.status is None:
            return ""
        size = self.status.team_size
        if size != team_size:
            return f"the running monitor's team has {counted(size, 'robot')}, not {team_size} as asked for here"
        if ids is not None and self.ids and self.ids != sorted(ids):
            has, asked = format_robot_ids(self.ids), format_robot_ids(ids)
            return f"the running monitor's team has robots {has}; asked for here: {asked}"
        return ""


log = logging.getLogger("zteam")

LOOK_FOR = 1.0
"""Host seconds in which a running monitor has to answer, and then to say what it waits for."""


class MonitorView:
    """The running monitor's team on the bus. Callbacks run under `node.changed`."""

    def __init__(self, node: ProcessNode, options: MonitorOptions) -> None:
        self._node = node
        self._options = options
        self._compared = options.team_size == 0
        """Whether it was told how the running monitor's team differs from the one asked for."""
        self.team = FollowedTeam()
        node.subscribe(names.TEAM_STATUS, TeamStatus, self._on_team_status, latched=True)
        self.watch = TeamWatch(node, self.team)

    def _on_team_status(self, _key: str, status: TeamStatus) -> None:
        self.team.take_team(status)
        if not self._compared:
            self._compared = True
            difference = self.team.differs_from(self._options.team_size, self._options.ids)
            if difference:
                self.team.members.tell("team", None, difference)

    def run(self, output: Output) -> None:
        """Show the team until the process is asked to stop, or until GO with `exit_on_go`."""
        # A table without the running monitor's robots would say nothing.
        self._node.wait(lambda: self.team.status is not None, LOOK_FOR)
        display = Display(self._node, self.team, self.watch, self._options, output)
        while not self._node.stopping:
            self.watch.writers.look()
            with self._node.changed:
                self.watch.take_losses()
            if display.update():
                return
            self._node.wait(lambda: self.team.members.has_events, 0.2)


def run_view(node: ProcessNode, options: MonitorOptions) -> None:
    """Show the running monitor's team. Raises UsageError if none runs."""
    # It answers no query as the monitor, and its log is not the monitor's.
    node.claim.release()
    info = _find_monitor(node)
    if info is None:
        raise UsageError(
            "no monitor is running: give the number of robots to wait for (--team-size 4) or their ids (--ids 0 1 2 3)"
        )
    since = (wall_ns() - info.start) / 1e9
    log.info(
        "a monitor is running already (process %d on %s, for %.0f s): this shows its team; Ctrl+C ends this view only",
        info.pid, info.host, since,
    )  # fmt: skip
    if options.table is None and not options.exit_on_go:
        # Where there is no terminal the table is shown at least once: it is what was asked for.
        options = msgspec.structs.replace(options, table=math.inf)
    view = MonitorView(node, options)
    with showing(options) as output:
        view.run(output)


def _find_monitor(node: ProcessNode) -> ProcessInfo | None:
    end = monotonic() + LOOK_FOR
    while not node.stopping:
        try:
            answers = node.bus.query(names.info_key(names.MONITOR), ProcessInfo, timeout=LOOK_FOR)
        except BusError as error:
            log.debug("%s", error)
            answers = []
        if answers:
            return answers[0][1]
        if monotonic() > end:
            return None
        # A session that was just opened may not see the other processes yet.
        node.wait(lambda: False, 0.1)
    return None
