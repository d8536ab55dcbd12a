"""How long processes that are started again were away, by what the team's bus tells."""

import logging
import threading
from collections.abc import Callable

from zteam import names
from zteam.bus import Bus, NoRequest
from zteam.clock import monotonic
from zteam.messages import RobotStatus
from zteam.node.kinds import ROUTER
from zteam.node.restarts import Restarted

log = logging.getLogger("zteam")

_MEANINGS = {names.SIMULATOR: ": the world stands at its start again"}
"""What else a user must know of a process that is back."""


class Recoveries:
    """Tells when a process that failed is back, and remembers how long that took.

    The router is back with the launcher's link, a robot with the first status that says it is ready, and any other
    process with its token. A program that holds no name on the bus is never known to be back.
    """

    def __init__(self, bus: Bus, counts: Callable[[], dict[str, int]]) -> None:
        """`counts()` are the restarts so far, by name."""
        self._bus = bus
        self._counts = counts
        self._lock = threading.Lock()
        self._failed: dict[str, float] = {}
        """Host times of the failures of those that are away."""
        self._unready: set[str] = set()
        """Robots that are away and whose process is back."""
        self._heard: set[str] = set()
        """Robots whose status this hears: a robot that never failed is not heard."""
        self.seconds: dict[str, float] = {}
        """The longest time that each was away, in host seconds."""
        bus.watch_link(self._on_link)
        bus.watch_tokens([names.tokens_key()], self._on_token)
        bus.serve(names.service_key(names.LAUNCHER, names.RESTARTS), NoRequest, lambda _: self.restarted())

    def note_failure(self, name: str) -> None:
        """The process has failed now and will be started again. One that fails before it is back goes on being away."""
        with self._lock:
            self._failed.setdefault(name, monotonic())

    def restarted(self) -> dict[str, Restarted]:
        """What was started again, by name."""
        return {name: Restarted(count, self.seconds.get(name)) for name, count in self._counts().items()}

    def _on_link(self, up: bool) -> None:
        if up:
            self._take_return(ROUTER)

    def _on_token(self, key: str, alive: bool) -> None:
        name = (names.split_token_key(key) or ("",))[0]
        if not alive or name not in self._failed:
            return
        robot_id = names.robot_id_of(name)
        if robot_id is None:
            self._take_return(name)
            return
        self._unready.add(name)
        if name not in self._heard:
            self._heard.add(name)
            self._bus.subscribe(names.robot_key(robot_id, names.STATUS), RobotStatus, self._on_status)

    def _on_status(self, key: str, status: RobotStatus) -> None:
        name = key.partition("/")[0]
        if status.is_ready and name in self._unready:
            self._unready.discard(name)
            self._take_return(name)

    def _take_return(self, name: str) -> None:
        with self._lock:
            failed = self._failed.pop(name, None)
            if failed is None:
                return
            away = monotonic() - failed
            self.seconds[name] = max(away, self.seconds.get(name, 0.0))
        log.info("%s is back after %.1f s%s", name, away, _MEANINGS.get(name, ""))
