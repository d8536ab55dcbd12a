"""Which processes command the robots, as the monitor sees it."""

import logging
from collections.abc import Mapping, Sequence

from zteam import names
from zteam.bus.presence import holder_text
from zteam.bus.transport import RawSample
from zteam.clock import Every, monotonic
from zteam.errors import BusError
from zteam.nodes.monitor.team import Team
from zteam.runtime.process_node import ProcessNode
from zteam.runtime.tokens import TokenSet, Writers
from zteam.services.simulator import SimStatus

log = logging.getLogger("zteam")

LOOK = 2.0
"""Host seconds between two looks."""
_ANSWER_LIMIT = 0.5
"""Host seconds that a look waits for the simulator; the gate waits meanwhile."""


class WriterWatch:
    """Tells of robots that more than one process commands, and the team which robots the simulator has.

    The simulator tells which ones they are: a subscription to all commands would slow down every tick of lock-step.
    Where there is no simulator, the watch subscribes to the commands itself.
    """

    def __init__(self, node: ProcessNode, team: Team) -> None:
        self._node = node
        self._team = team
        self._tokens = TokenSet()
        self._due = Every(LOOK)
        self._heard: Writers | None = None
        self._told: dict[int, list[str]] = {}
        """Sessions that command a robot, where there is more than one."""

    def take_token(self, name: str, session: str, alive: bool) -> None:
        """A presence token came or went."""
        self._tokens.take(name, session, alive)

    def look(self) -> None:
        """Look once every LOOK seconds. Main loop only, without `node.changed`."""
        if not self._due.due():
            return
        found = self._ask() if names.SIMULATOR in self._tokens else self._listen()
        if found is not None:
            with self._node.changed:
                self._tell(found)

    def _ask(self) -> Mapping[int, Sequence[str]] | None:
        try:
            key = names.service_key(names.SIMULATOR, "status")
            status = self._node.bus.ask(key, SimStatus, timeout=_ANSWER_LIMIT)
        except BusError as error:
            log.debug("%s", error)
            return None
        with self._node.changed:
            self._team.take_world(status.robots)
        return status.writers

    def _listen(self) -> Mapping[int, Sequence[str]] | None:
        clock = self._node.clock
        if not clock.decided or clock.simulated:
            return None
        if self._heard is None:
            self._heard = Writers()
            self._node.bus.subscribe_raw(names.all_robots_key(names.CMD_VEL), self._on_command)
        with self._node.changed:
            heard = self._heard.recent(monotonic())
        return {robot_id: sorted(sessions) for robot_id, sessions in heard.items() if len(sessions) > 1}

    def _on_command(self, sample: RawSample) -> None:
        target = names.split_robot_key(sample.key)
        if target is not None and self._heard is not None:
            with self._node.changed:
                self._heard.take(target[0], sample.source, monotonic())

    def _tell(self, found: Mapping[int, Sequence[str]]) -> None:
        for robot_id, sessions in found.items():
            if self._told.get(robot_id) != list(sessions):
                writers = ", ".join(holder_text(self._tokens.name_of(session), session) for session in sessions)
                key = names.robot_key(robot_id, names.CMD_VEL)
                text = f"is commanded by {len(sessions)} processes: {writers} (see 'zteam topic info {key}')"
                self._team.members.tell("writers", robot_id, text)
        for robot_id in self._told.keys() - found.keys():
            self._team.members.tell("writers", robot_id, "is commanded by one process again")
        self._told = {robot_id: list(sessions) for robot_id, sessions in found.items()}
