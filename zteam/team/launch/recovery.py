"""How long processes that are started again were away."""

import logging
from collections.abc import Callable

from zteam import names
from zteam.bus import NoRequest
from zteam.clock import monotonic
from zteam.messages import RobotStatus
from zteam.monitor.observer import LINK, PRESENCE, RobotView, TeamObserver
from zteam.node.kinds import ROUTER
from zteam.node.launcher import Restarted

log = logging.getLogger("zteam")

_MEANINGS = {names.SIMULATOR: ": the world stands at its start again"}
"""What else a user must know of a process that is back."""


class Recoveries:
    """Logs when a process that failed is back, and how long that took.

    The router is back with the launcher's link, a robot with its first status that is ready, any other process with
    its token. A program without a name on the bus is never back.
    """

    def __init__(self, observer: TeamObserver, counts: Callable[[], dict[str, int]]) -> None:
        """`counts()` are the restarts so far, by name."""
        self._observer, self._counts = observer, counts
        self._failed: dict[str, float] = {}
        """Host times of the failures of those that are away."""
        self._unready: set[str] = set()
        """Robots that are away and whose process is back."""
        self.seconds: dict[str, float] = {}
        """The longest time that each was away, in host seconds."""
        observer.on(LINK, lambda _, up: self._end(ROUTER) if up else None)
        observer.on(PRESENCE, self._on_presence)
        observer.on(names.STATUS, self._on_status)
        observer.bus.serve(names.service_key(names.LAUNCHER, names.RESTARTS), NoRequest, lambda _: self.restarted())

    def note_failure(self, name: str) -> None:
        """The process has failed now and will be started again. One that fails before it is back is away since then."""
        self._failed.setdefault(name, monotonic())
        if (robot_id := names.robot_id_of(name)) is not None:
            self._observer.observe(names.STATUS, robot_id=robot_id)

    def restarted(self) -> dict[str, Restarted]:
        """What was started again, by name."""
        return {name: Restarted(count, self.seconds.get(name)) for name, count in self._counts().items()}

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
            self.seconds[name] = max(away, self.seconds.get(name, 0.0))
            log.info("%s is back after %.1f s%s", name, away, _MEANINGS.get(name, ""))
