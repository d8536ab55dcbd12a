"""A running team at a glance, heard and asked on the bus: what `zteam up` shows of it."""

import logging
import threading
from collections.abc import Collection

import msgspec

from zteam import names
from zteam.bus import Bus
from zteam.clock import to_seconds
from zteam.messages import RobotState, RobotStatus, TeamState, TeamStatus, ns_from_time
from zteam.services.simulator import SimStatus, find_status

log = logging.getLogger("zteam")

_ANSWER_LIMIT = 2.0
"""Host seconds that one look waits for the simulator."""


class Overview(msgspec.Struct, frozen=True, kw_only=True):
    """One look at a team."""

    robots: int
    driving: int = 0
    """Robots that run and have no reason to stand."""
    team: TeamStatus | None = None
    """The monitor's newest; None before the first."""
    simulator: SimStatus | None = None
    """None if none answers."""
    is_simulated: bool = True
    held_by: str = ""
    """Lock-step: what has held the world since the look before."""

    @property
    def begun(self) -> bool:
        """Whether GO was given."""
        return self.team is not None and self.team.state == TeamState.GO

    @property
    def elapsed(self) -> float | None:
        """Simulated seconds since GO; None before GO and without an answer of the simulator."""
        if self.simulator is None or self.team is None or not self.begun:
            return None
        return max(0.0, to_seconds(self.simulator.now - ns_from_time(self.team.go_stamp)))


class TeamOverview:
    """Listens to the monitor and to the robots `ids`, and asks the simulator, if there is one, at each look."""

    def __init__(self, bus: Bus, ids: Collection[int], is_simulated: bool) -> None:
        self._bus = bus
        self._ids = frozenset(ids)
        self._is_simulated = is_simulated
        self._lock = threading.Lock()
        self._team: TeamStatus | None = None
        self._robots: dict[int, RobotStatus] = {}
        self._tick = -1
        bus.subscribe(names.TEAM_STATUS, TeamStatus, self._on_team_status, latched=True)
        bus.subscribe(names.all_robots_key(names.STATUS), RobotStatus, self._on_robot_status)

    def _on_team_status(self, _key: str, status: TeamStatus) -> None:
        with self._lock:
            self._team = status

    def _on_robot_status(self, key: str, status: RobotStatus) -> None:
        target = names.split_robot_key(key)
        if target is not None and target[0] in self._ids:
            with self._lock:
                self._robots[target[0]] = status

    def look(self) -> Overview:
        """The team now. Waits for the simulator's answer."""
        simulator = find_status(self._bus, _ANSWER_LIMIT) if self._is_simulated else None
        held_by = ""
        if simulator is not None:
            # Every tick waits for participants; it is held only if it was open at the look before.
            held_by = simulator.waiting_for if simulator.tick == self._tick and not simulator.paused else ""
            self._tick = simulator.tick
        with self._lock:
            lost = set() if self._team is None else set(self._team.lost.tolist())
            present = [status for i, status in self._robots.items() if i not in lost]
            return Overview(
                robots=len(self._ids),
                driving=sum(status.state == RobotState.RUNNING and not status.reason for status in present),
                team=self._team,
                simulator=simulator,
                is_simulated=self._is_simulated,
                held_by=held_by,
            )
