"""The progress of a run, the processes that are started again, and the team at a glance, for the launcher."""

import threading
from collections.abc import Callable, Collection

import msgspec

from zteam import names
from zteam.bus import Bus, NoRequest
from zteam.clock import HOST_FACTOR, monotonic, pause, to_seconds
from zteam.errors import ZteamError, log
from zteam.messages import RobotState, RobotStatus, TeamState, TeamStatus, ns_from_time
from zteam.monitor.observer import LINK, PRESENCE, RobotView, TeamObserver
from zteam.node.kinds import ROUTER
from zteam.node.launcher import Restarted
from zteam.simulator.client import FinishReply, SimStatus, WaitRequest, find_status

_FINISH_WAIT = 5.0 * HOST_FACTOR
"""Host seconds that one request for the end of the run waits."""


class Progress:
    """When GO was given and when the run ended, in host seconds since the launcher's start, None before; and how long
    processes that failed were away, which is logged when they are back.

    The router is back with the launcher's link, a robot with its first status that is ready, any other process with
    its token. A program without a name on the bus is never back.
    """

    def __init__(
        self, observer: TeamObserver, since_start: Callable[[], float], counts: Callable[[], dict[str, int]]
    ) -> None:
        """`counts()` are the restarts so far, by name."""
        self.wall: float | None = None
        self.away: dict[str, float] = {}
        """The longest time that each process was away, in host seconds."""
        self._observer, self._since_start, self._counts = observer, since_start, counts
        self._failed: dict[str, float] = {}
        """Host times of the failures of those that are away."""
        self._unready: set[str] = set()
        """Robots that are away and whose process is back."""
        self._closed = False
        observer.observe(names.TEAM_STATUS)
        observer.on(LINK, lambda _, up: self._end(ROUTER) if up else None)
        observer.on(PRESENCE, self._on_presence)
        observer.on(names.STATUS, self._on_status)
        observer.bus.serve(names.service_key(names.LAUNCHER, names.RESTARTS), NoRequest, lambda _: self.restarted())

    @property
    def go_after(self) -> float | None:
        """When the first GO was given."""
        go_at = self._observer.go_at
        return None if go_at is None else self._since_start() - (monotonic() - go_at)

    def watch_end(self, on_end: Callable[[], None]) -> None:
        """Ask the simulator for the end until `close`: subscribing to its clock would slow a fast run down."""
        threading.Thread(target=self._watch_end, args=(on_end,), name="end of the run", daemon=True).start()

    def _watch_end(self, on_end: Callable[[], None]) -> None:
        key, request = names.service_key(names.SIMULATOR, "finish"), WaitRequest(timeout=_FINISH_WAIT)
        while not self._closed:
            answers = self._observer.bus.find(key, FinishReply, request, timeout=_FINISH_WAIT + 2.0)
            if any(answer.finished for _, answer in answers):
                self.wall = self._since_start()
                on_end()
                return
            if not answers:
                # No simulator yet, and nothing notifies when its query is there.
                pause(0.1)

    def close(self) -> None:
        """Stop asking for the end of the run."""
        self._closed = True

    def check_begun(self, seconds: float) -> None:
        """Raise ZteamError without GO, or if lock-step still holds its first tick: it waits for nodes too."""
        if self._observer.go_at is None:
            status = self._observer.team_status
            lack = "the monitor's first message" if status is None else status.waiting_for
            raise ZteamError(f"no GO within {seconds:g} s: waiting for {lack}")
        if holders := holders_of_first_tick(self._observer.bus):
            raise ZteamError(f"the first tick is held for {seconds:g} s: waiting for {holders}")

    def note_failure(self, name: str) -> None:
        """The process has failed now and will be started again. One that fails before it is back is away since then."""
        self._failed.setdefault(name, monotonic())
        if (robot_id := names.robot_id_of(name)) is not None:
            self._observer.observe(names.STATUS, robot_id=robot_id)

    def restarted(self) -> dict[str, Restarted]:
        return {name: Restarted(count, self.away.get(name)) for name, count in self._counts().items()}

    def _on_presence(self, name: str, alive: bool) -> None:
        if alive and name in self._failed:
            (self._end if names.robot_id_of(name) is None else self._unready.add)(name)

    def _on_status(self, robot: RobotView, status: RobotStatus) -> None:
        if status.is_ready and robot.name in self._unready:
            self._unready.discard(robot.name)
            self._end(robot.name)

    def _end(self, name: str) -> None:
        if (failed := self._failed.pop(name, None)) is not None:
            away = monotonic() - failed
            self.away[name] = max(away, self.away.get(name, 0.0))
            more = ": the world stands at its start again" if name == names.SIMULATOR else ""
            log.info("%s is back after %.1f s%s", name, away, more)


def holders_of_first_tick(bus: Bus) -> str:
    """What lock-step waits for, if it still holds its first tick; empty if it does not. Asks the simulator."""
    status = find_status(bus)
    return "" if status is None or not status.lockstep or status.tick > 1 else status.waiting_for


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
    """Observes the robots `ids`, and asks the simulator, if there is one, at each look."""

    def __init__(self, observer: TeamObserver, ids: Collection[int], is_simulated: bool) -> None:
        self._observer, self._ids, self._is_simulated = observer, frozenset(ids), is_simulated
        self._tick = -1
        observer.observe(names.TEAM_STATUS, names.STATUS)

    def look(self) -> Overview:
        """The team now. Waits for the simulator's answer."""
        simulator = find_status(self._observer.bus) if self._is_simulated else None
        held_by = ""
        if simulator is not None:
            # Every tick waits for participants; it is held only if it was open at the look before.
            held_by = simulator.waiting_for if simulator.tick == self._tick and not simulator.paused else ""
            self._tick = simulator.tick
        team = self._observer.team_status
        present = self._ids.difference([] if team is None else team.lost.tolist())
        statuses = [status for i in present if (status := self._observer.robot(i).status) is not None]
        return Overview(
            robots=len(self._ids),
            driving=sum(status.state == RobotState.RUNNING and not status.reason for status in statuses),
            team=team,
            simulator=simulator,
            is_simulated=self._is_simulated,
            held_by=held_by,
        )
