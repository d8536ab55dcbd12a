"""A view of a monitor that runs already: its table and its GO."""

import logging
import math

import msgspec

from zteam import names
from zteam.bus.presence import ProcessInfo, find_processes
from zteam.clock import monotonic
from zteam.errors import UsageError
from zteam.messages import TeamState, TeamStatus
from zteam.monitor.process.display import TeamDisplay, showing
from zteam.monitor.process.members import KnownRobot
from zteam.monitor.process.start_gate import Gate
from zteam.monitor.process.watch import TeamWatch
from zteam.node.process_node import ProcessNode
from zteam.node.process_options import MonitorOptions

_OF_THE_MONITOR = frozenset({"ready", "late", "unexpected"})
"""Kinds of events that the running monitor tells: here they would come a second time."""


class FollowedTeam(Gate):
    """The gate of a running monitor, which decides which robots GO waits for, and when it is out. The robots and their
    processes are observed directly."""

    def __init__(self) -> None:
        super().__init__(None, 0)
        self.newest: TeamStatus | None = None
        """What the running monitor said last."""

    def take_team(self, status: TeamStatus) -> None:
        before, self.newest = self.newest, status
        self.gone, self.epoch, self.team_size = status.state == TeamState.GO, status.epoch, status.team_size
        ids = sorted({*status.ready.tolist(), *status.missing.tolist()})
        self.expected = ids if self.gone or status.missing.size else None
        for robot_id in ids:
            self.get(robot_id)
        if self.gone and before is not None and before.state != TeamState.GO:
            self.tell("go", None, "All robots GO!")
        else:
            ready = f"{status.ready.size} of {status.team_size} ready"
            waiting_for = status.waiting_for or self.waiting_for()
            self.tell("status", None, f"GO is out; {ready}" if self.gone else f"{ready}; waiting for {waiting_for}")

    def tell(self, kind: str, robot: int | None, text: str) -> None:
        if kind not in _OF_THE_MONITOR:
            super().tell(kind, robot, text)

    def _adopt(self, robot_id: int, member: KnownRobot) -> None:
        """The running monitor reports GO."""

    def take_simulator(self, sessions: frozenset[str]) -> None:
        """The running monitor reports the epoch."""

    def waiting_for(self, *, reasons: bool = True) -> str:
        return super().waiting_for(reasons=reasons) or "the running monitor"


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
    team = FollowedTeam()
    watch = TeamWatch(node, team)
    watch.on(names.TEAM_STATUS, lambda _key, status: team.take_team(status))
    with showing(options) as output:
        # A table without the running monitor's robots would say nothing.
        node.wait(lambda: team.newest is not None, LOOK_FOR)
        TeamDisplay(node, team, watch, options, output).run()


def _find_monitor(node: ProcessNode) -> ProcessInfo | None:
    end = monotonic() + LOOK_FOR
    while not node.stopping:
        if answers := find_processes(node.bus, names.MONITOR, timeout=LOOK_FOR):
            return answers[0]
        if monotonic() > end:
            return None
        # A session that was just opened may not reach the other processes yet.
        node.wait(lambda: False, 0.1)
    return None
