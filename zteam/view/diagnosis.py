"""What the doctor finds, for the pages that show it."""

import logging
import threading
from collections.abc import Callable, Sequence

import msgspec

from zteam.bus import BusOptions
from zteam.clock import monotonic, wall_ns
from zteam.errors import ZteamError
from zteam.monitor.doctor.examination import examine
from zteam.monitor.doctor.facts import Finding

log = logging.getLogger("zteam")

FRESH = 30.0
"""Host seconds after which a page that opens it begins another run; its button does so at any time."""


_MOST = 500
"""Findings that a page gets: a hostile team may cause any number."""


class Examination(msgspec.Struct):
    """The document `doctor`."""

    running: bool = False
    """Whether it is being made anew."""
    time: float = 0.0
    """When it was made, seconds since the Unix epoch; 0: not yet."""
    findings: Sequence[Finding] = ()
    """As `zteam doctor --json` prints them."""
    error: str = ""
    """Why there are none."""


class Diagnosis:
    """Examines the team, one time after the other, on a session and a thread of its own: it listens to all keys of the
    team, and pages must not wait for it. Threads may make calls at the same time."""

    def __init__(self, options: BusOptions | None, on_news: Callable[[], None]) -> None:
        """`options` is how to reach the team; None for a bus in memory, which no other session can join."""
        self._options, self._on_news = options, on_news
        self._lock = threading.Lock()
        self._wanted = False
        self._found = Examination()
        self._begun = float("-inf")
        """Host time of the newest run."""

    @property
    def document(self) -> bytes:
        return msgspec.json.encode(self._found)

    def want(self, wanted: bool) -> None:
        """Whether some page shows it: it is made when the first one begins to, unless it is fresh."""
        before, self._wanted = self._wanted, wanted
        if wanted and not before and monotonic() - self._begun > FRESH:
            self.start()

    def start(self) -> None:
        """Make it anew, unless that goes on already."""
        with self._lock:
            if self._found.running:
                return
            if self._options is None:
                self._found = Examination(error="the team is in one process, which no other one can look at")
                return
            self._begun = monotonic()
            self._found = msgspec.structs.replace(self._found, running=True)
            threading.Thread(target=self._run, args=(self._options,), name="doctor", daemon=True).start()

    def _run(self, options: BusOptions) -> None:
        found = Examination()
        try:
            found.findings, found.time = examine(options)[:_MOST], wall_ns() / 1e9
        except ZteamError as error:
            found.error = f"{error}: try 'zteam doctor' in a terminal"
        except Exception as error:
            # What it judges comes from a team, which may be hostile: the view goes on.
            log.exception("doctor")
            found.error = f"the examination failed: {error!r:.1000}"
        self._found = found
        self._on_news()
