"""Messages that were long on their way, told by their time stamps although the clocks of hosts differ. Pure.

A message's delay is that of its link plus the difference of two clocks, which is not known. So a session is measured
by itself: its quickest message tells the difference, and what a message took longer than that one is its lateness.
"""

from zteam.bus.transport import RawSample
from zteam.clock import monotonic

LATE = 0.5
"""Host seconds from which on a message is too old to act on, as other old data is."""
CLOCKS_APART = 1.0
"""Seconds that the clocks of hosts may differ: a session whose quickest message took longer has a slow link."""
_LONGEST_LINK = 10.0
"""Seconds beyond which no link explains a quickest message: that clock was never set, or set again."""
_FORGETTING = 1e-3
"""Seconds a second by which the quickest message is forgotten: clocks drift, and are set at half this rate at most."""
_MAX_SESSIONS = 4096
"""A sender can invent sessions; beyond this many each message is measured by itself."""


class Lateness:
    """How late the messages of each session come. Fed with all of them, in the order of their arrival."""

    def __init__(self) -> None:
        self._quickest: dict[str, tuple[float, float]] = {}
        """By session: the shortest delay, and the host time of the last message."""

    def measure(self, session: str, delay: float, now: float) -> float:
        """Host seconds by which a message that comes at host time `now`, `delay` after its stamp, is late."""
        quickest, before = self._quickest.get(session, (delay, now))
        quickest = min(delay, quickest + _FORGETTING * (now - before))
        if session in self._quickest or len(self._quickest) < _MAX_SESSIONS:
            self._quickest[session] = quickest, now
        apart = quickest if quickest > _LONGEST_LINK else min(quickest, CLOCKS_APART)
        return delay - apart

    def problem(self, sample: RawSample) -> str:
        """Why a message that has just come is too old to act on; empty if it is in time."""
        is_late = self.measure(sample.source, sample.delay, monotonic()) > LATE
        # The same text each time: the log repeats it ever less often.
        return f"it came more than {LATE:g} s late: its link is slow, or was cut" if is_late else ""
