"""The start gate of a user's own node: what `zteam-robot` does by itself, READY and then GO, behind one option."""

from collections.abc import Callable, Sequence

from zteam import names
from zteam.clock import Every
from zteam.messages import RobotDriver, TeamState, TeamStatus, Twist, ns_from_time
from zteam.runtime.node import Node
from zteam.runtime.readiness import Readiness
from zteam.runtime.robot_status import StatusReport


class NodeGate:
    """Holds the steps of `node` until GO. A robot's own process (`robot_N`) also tells the monitor that it is ready.

    The node's main loop calls `beat` and `is_open`; the caller of the others holds `node.changed`.
    """

    def __init__(self, node: Node, lacking: Callable[[], list[str]], in_lockstep: Callable[[], bool]) -> None:
        """`lacking()` names the inputs that are missing, `in_lockstep()` says whether ticks call the steps."""
        self._node = node
        self._in_lockstep = in_lockstep
        self._lacking = lacking
        self._readiness = Readiness(gated=True, way_out="zteam-monitor")
        robot_id = names.robot_id_of(node.name)
        self._report = None if robot_id is None else StatusReport(node, robot_id, "zteam.Node", self._readiness)
        self._heartbeat = Every(1.0)
        self._team = TeamStatus()
        """The monitor's newest word."""
        # Not as an input of the node: those tell whether this is a real base.
        node.bus.subscribe(names.TEAM_STATUS, TeamStatus, self._on_team_status, latched=True)
        node.watch_tokens(names.tokens_key(names.MONITOR), self._on_monitor)

    def _on_team_status(self, _key: str, status: TeamStatus) -> None:
        with self._node.changed:
            self._team = status
            self._node.changed.notify_all()

    def _on_monitor(self, _key: str, alive: bool) -> None:
        if alive:
            # A monitor that has just come must not wait for the next heartbeat to know this robot.
            self._publish()

    def _publish(self) -> None:
        # The word of a process that does not hold the name would count for the one that does.
        if self._report is None or not self._node.speaks:
            return
        if self._readiness.released and self._in_lockstep():
            self._report.repeat()
        else:
            self._report.publish()

    def beat(self) -> None:
        """Find out what is missing, and say once a second what the robot is."""
        with self._node.changed:
            self.passes(self._lacking(), 0)
            if self._heartbeat.due():
                self._publish()

    def is_open(self) -> bool:
        """In real time: whether the steps may begin, by the monitor's word. In lock-step the ticks carry GO."""
        with self._node.changed:
            team, now = self._team, self._node.clock.now()
            holds = team.state == TeamState.GO and now >= ns_from_time(team.go_stamp)
            return self.passes(self._lacking(), team.epoch if holds else 0)

    def passes(self, lacking: Sequence[str], epoch: int) -> bool:
        """Whether the steps may begin: nothing is `lacking` and GO `epoch` holds (0 = none); from then on for good."""
        was_released = self._readiness.released
        if self._readiness.take(lacking, epoch) and not was_released:
            self._readiness.drive("")
        self._tell()
        return self._readiness.released

    def take(self, command: Twist) -> None:
        """The newest command of the node's step."""
        if self._report is not None:
            self._report.take(RobotDriver.BEHAVIOR, command)
        self._tell()
        if self._report is not None and self._in_lockstep():
            self._report.keep_up(self._node.clock.now())

    def _tell(self) -> None:
        if self._report is not None and self._node.speaks:
            self._report.tell()

    def stop(self) -> None:
        """Say that the process ends."""
        if self._report is not None:
            self._readiness.stop()
            self._report.command = None
            self._report.publish()
