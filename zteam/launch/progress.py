"""The progress of a run, heard on the bus by the launcher."""

import logging
import threading

from zteam import names
from zteam.bus import Bus
from zteam.clock import pause
from zteam.errors import ZteamError
from zteam.launch.report import seconds_since_start
from zteam.messages import TeamState, TeamStatus
from zteam.services.simulator import FinishReply, FinishRequest

log = logging.getLogger("zteam")

_FINISH_WAIT = 5.0
"""Host seconds that one request for the end of the run waits."""


class Progress:
    """When GO was given and when the run ended, in host seconds since the launcher's start; None before."""

    def __init__(self, bus: Bus, has_end: bool) -> None:
        self.changed = threading.Condition()
        self.go_after: float | None = None
        self.wall: float | None = None
        self._bus = bus
        self._closed = False
        bus.subscribe(names.TEAM_STATUS, TeamStatus, self._on_team_status, latched=True)
        if has_end:
            # The simulator is asked for the end, because subscribing to its clock would slow a fast run down.
            threading.Thread(target=self._watch_end, name="end of the run", daemon=True).start()

    def _on_team_status(self, _key: str, status: TeamStatus) -> None:
        if status.state == TeamState.GO and self.go_after is None:
            with self.changed:
                self.go_after = seconds_since_start()
                self.changed.notify_all()

    def _watch_end(self) -> None:
        key, request = names.service_key(names.SIMULATOR, "finish"), FinishRequest(timeout=_FINISH_WAIT)
        while not self._closed:
            try:
                answers = self._bus.query(key, FinishReply, request, timeout=_FINISH_WAIT + 2.0)
            except ZteamError as error:
                log.debug("%s", error)
                answers = []
            if any(answer.finished for _, answer in answers):
                with self.changed:
                    self.wall = seconds_since_start()
                    self.changed.notify_all()
                return
            if not answers:
                # No simulator yet, and nothing notifies when its query is there.
                pause(0.1)

    def close(self) -> None:
        """Stop asking for the end of the run."""
        self._closed = True

    def wake(self) -> None:
        """Make every waiter on `changed` check its condition."""
        with self.changed:
            self.changed.notify_all()
