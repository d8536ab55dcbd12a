"""A view of a monitor that runs already: its table and its GO, without a gate of its own."""

import logging
import math
from collections.abc import Sequence

import msgspec

from zteam import names
from zteam.bus.presence import ProcessInfo, find_processes
from zteam.clock import monotonic
from zteam.config.numbers import counted
from zteam.config.robot_ids import format_robot_ids
from zteam.errors import UsageError
from zteam.messages import TeamState, TeamStatus
from zteam.monitor.process.display import TeamDisplay, showing
from zteam.monitor.process.members import WatchedTeam
from zteam.monitor.process.watch import TeamWatch
from zteam.node.process_node import ProcessNode
from zteam.node.process_options import MonitorOptions


class FollowedTeam(WatchedTeam):
    """GO, and what it waits for, are the running monitor's; robots and their processes are seen directly."""

    def __init__(self, team_size: int = 0, ids: Sequence[int] | None = None) -> None:
        """The size and the ids that were asked for; 0 for none."""
        super().__init__()
        self._team_size, self._asked = team_size, ids
        self.status: TeamStatus | None = None
        """What the running monitor said last."""

    @property
    def ids(self) -> list[int]:
        """The robots that the running monitor waits for, as far as it names them."""
        return [] if self.status is None else sorted({*self.status.ready.tolist(), *self.status.missing.tolist()})

    def counts(self, robot_id: int) -> bool:
        """Whether GO waits for this robot, or has."""
        return robot_id in self.ids

    def take_team(self, status: TeamStatus) -> None:
        was_gone, was_known, self.status = self.gone, self.status is not None, status
        self.gone, self.epoch = status.state == TeamState.GO, status.epoch
        for robot_id in self.ids:
            self.get(robot_id)
        if self.gone and was_known and not was_gone:
            self.tell("go", None, "All robots GO!")
        else:
            self.tell("status", None, self._in_words(status))
        if not was_known and self._team_size and (difference := self._difference(status.team_size)):
            self.tell("team", None, difference)

    def _in_words(self, status: TeamStatus) -> str:
        ready = f"{status.ready.size} of {status.team_size} ready"
        return f"GO is out; {ready}" if self.gone else f"{ready}; waiting for {self.waiting_for()}"

    def waiting_for(self) -> str:
        status = self.status
        if status is None:
            return "the running monitor"
        # A monitor that is not of zteam may leave the reasons out.
        return status.waiting_for or ", ".join(map(names.robot_name, status.missing.tolist()))

    def unready(self) -> list[int]:
        """Ids of the known robots that GO waits for."""
        status = self.status
        if status is None or self.gone:
            return []
        there = [i for i, member in self.members.items() if member.alive and not member.ready]
        return status.missing.tolist() or sorted(there)

    def unknown(self) -> int:
        """How many further robots GO waits for, whatever their ids are."""
        status = self.status
        if status is None or self.gone or status.missing.size:
            return 0
        return max(0, status.team_size - status.ready.size - len(self.unready()))

    def awaited(self) -> str:
        """What GO waits for, without the reasons, which each robot's row has."""
        return super().awaited() or self.waiting_for()

    def _difference(self, size: int) -> str:
        """How the running monitor's team, of this size, differs from the one asked for; empty if it does not."""
        if size != self._team_size:
            return f"the running monitor's team has {counted(size, 'robot')}, not {self._team_size} as asked for here"
        if self._asked is not None and self.ids and self.ids != sorted(self._asked):
            has, asked = format_robot_ids(self.ids), format_robot_ids(self._asked)
            return f"the running monitor's team has robots {has}; asked for here: {asked}"
        return ""


log = logging.getLogger("zteam")

LOOK_FOR = 1.0
"""Host seconds in which a running monitor has to answer, and then to say what it waits for."""


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
    team = FollowedTeam(options.team_size, options.ids)
    watch = TeamWatch(node, team)
    watch.on(names.TEAM_STATUS, lambda _key, status: team.take_team(status))
    with showing(options) as output:
        # A table without the running monitor's robots would say nothing.
        node.wait(lambda: team.status is not None, LOOK_FOR)
        TeamDisplay(node, team, watch, options, output).run()


def _find_monitor(node: ProcessNode) -> ProcessInfo | None:
    end = monotonic() + LOOK_FOR
    while not node.stopping:
        if answers := find_processes(node.bus, names.MONITOR, timeout=LOOK_FOR):
            return answers[0]
        if monotonic() > end:
            return None
        # A session that was just opened may not see the other processes yet.
        node.wait(lambda: False, 0.1)
    return None
