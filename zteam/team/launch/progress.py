"""The progress of a run and the team at a glance, heard and asked on the bus by the launcher."""

import threading
from collections.abc import Callable, Collection
from threading import Condition

import msgspec

from zteam import names
from zteam.bus import Bus
from zteam.clock import HOST_FACTOR, pause, to_seconds
from zteam.errors import ZteamError
from zteam.messages import RobotState, RobotStatus, TeamState, TeamStatus, ns_from_time
from zteam.simulator.client import FinishReply, SimStatus, WaitRequest, find_status

_ANSWER_LIMIT = 2.0
"""Host seconds that one look waits for the simulator."""
_FINISH_WAIT = 5.0 * HOST_FACTOR
"""Host seconds that one request for the end of the run waits."""


class Progress:
    """When GO was given and when the run ended, in host seconds since the launcher's start; None before.

    It notifies `changed`.
    """

    def __init__(self, bus: Bus, has_end: bool, changed: Condition, since_start: Callable[[], float]) -> None:
        self.go_after: float | None = None
        self.wall: float | None = None
        self._bus = bus
        self._changed = changed
        self._since_start = since_start
        self._waiting_for = "the monitor's first message"
        """What GO waits for, in the monitor's words."""
        self._closed = False
        bus.subscribe(names.TEAM_STATUS, TeamStatus, self._on_team_status, latched=True)
        if has_end:
            # The simulator is asked for the end, because subscribing to its clock would slow a fast run down.
            threading.Thread(target=self._watch_end, name="end of the run", daemon=True).start()

    def _on_team_status(self, _key: str, status: TeamStatus) -> None:
        self._waiting_for = status.waiting_for
        if status.state == TeamState.GO and self.go_after is None:
            with self._changed:
                self.go_after = self._since_start()
                self._changed.notify_all()

    def _watch_end(self) -> None:
        key, request = names.service_key(names.SIMULATOR, "finish"), WaitRequest(timeout=_FINISH_WAIT)
        while not self._closed:
            answers = self._bus.find(key, FinishReply, request, timeout=_FINISH_WAIT + 2.0)
            if any(answer.finished for _, answer in answers):
                with self._changed:
                    self.wall = self._since_start()
                    self._changed.notify_all()
                return
            if not answers:
                # No simulator yet, and nothing notifies when its query is there.
                pause(0.1)

    def close(self) -> None:
        """Stop asking for the end of the run."""
        self._closed = True

    def check_begun(self, seconds: float) -> None:
        """Raise ZteamError without GO, or if lock-step still holds its first tick: it waits for nodes too."""
        if self.go_after is None:
            raise ZteamError(f"no GO within {seconds:g} s: waiting for {self._waiting_for}")
        if holders := self._holders_of_first_tick():
            raise ZteamError(f"the first tick is held for {seconds:g} s: waiting for {holders}")

    @property
    def first_tick_is_held(self) -> bool:
        """Whether lock-step still holds its first tick, by a question to the simulator."""
        return bool(self._holders_of_first_tick())

    def _holders_of_first_tick(self) -> str:
        status = find_status(self._bus)
        if status is None or not status.lockstep or status.tick > 1:
            return ""
        return status.waiting_for


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
