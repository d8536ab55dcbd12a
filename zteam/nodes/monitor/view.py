"""A view of a monitor that runs already: its table and its GO, without a gate of its own."""

import logging
import math

import msgspec

from zteam import names
from zteam.bus.presence import ProcessInfo
from zteam.clock import monotonic, wall_ns
from zteam.errors import BusError, UsageError
from zteam.messages import TeamStatus
from zteam.nodes.monitor.display import Display, Output, showing
from zteam.nodes.monitor.followed_team import FollowedTeam
from zteam.nodes.monitor.team_watch import TeamWatch
from zteam.process_options import MonitorOptions
from zteam.runtime.process_node import ProcessNode

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
