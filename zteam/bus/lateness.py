"""Messages that were long on their way, found by their time stamps although the clocks of hosts differ. Pure.

A message's delay is that of its link plus the difference of two clocks, which is not known. So each key is measured by
itself: its quickest message of the last seconds shows the difference, and what a message took longer than that one is
its lateness. The sender chooses a time stamp, so the session's id in it plays no part, and a stamp that is ahead of the
host's clock is taken for one of now: it makes no later message late.
"""

import math

from zteam.bus.transport import RawSample
from zteam.clock import FREEZES, monotonic

LATE = 0.5
"""Host seconds from which on a message is too old to act on, as other old data is."""
CLOCKS_APART = 1.0
"""Seconds that the clocks of hosts may differ: a key whose quickest message took longer has a slow link."""
_LONGEST_LINK = 10.0
"""Seconds beyond which no link explains a quickest message: that clock was never set, or set again."""
_WINDOW = 2.0
"""Host seconds after which the quickest message begins to be forgotten; after two windows it is."""
_LONGEST_GAP = 0.5
"""Host seconds that a pause between two messages counts at most: what a cut link held up is measured by what came
before the cut, however long that was."""


class _Key:
    def __init__(self, now: float) -> None:
        self._last, self._passed = now, 0.0
        self._near, self._far = [math.inf, math.inf], [math.inf, math.inf]
        """What the quickest messages of the window before and of this one took (s): of those that a link explains, and
        of the others."""
        self._is_slow = False
        """Whether its link was slow, when last a link explained all messages of a window."""

    def compare(self, took: float, now: float) -> float:
        """A message comes that took so long (s); how long the quickest one took that it is compared with."""
        self._passed += min(now - self._last, _LONGEST_GAP)
        self._last = now
        if self._passed >= _WINDOW:
            self._passed = 0.0
            self._near, self._far = [self._near[1], math.inf], [self._far[1], math.inf]
            if self._near[0] < self._far[0] == math.inf:
                self._is_slow = self._near[0] > CLOCKS_APART
        near = min(self._near)
        if took <= _LONGEST_LINK:
            self._near[1] = min(took, self._near[1])
            return min(took, near, CLOCKS_APART)
        self._far[1] = min(took, self._far[1])
        # A link becomes slow little by little, a clock is set at once.
        return min(near, CLOCKS_APART) if near < math.inf or self._is_slow else min(self._far)


class Lateness:
    """How late the messages of each key come. Fed with all of them, in the order of their arrival."""

    def __init__(self) -> None:
        self._keys: dict[str, _Key] = {}

    def measure(self, key: str, delay: float, now: float) -> float:
        """Host seconds by which a message that comes on `key` at host time `now`, `delay` after its stamp, is late."""
        known = self._keys.get(key)
        if known is None:
            known = self._keys[key] = _Key(now)
        took = max(delay, 0.0)
        return took - known.compare(took, now)

    def problem(self, sample: RawSample) -> str:
        """Why a message that has just come is too old to act on; empty if it is in time."""
        now = monotonic()
        if self.measure(sample.key, sample.delay, now) <= LATE:
            return ""
        # The same text each time: the log repeats it ever less often.
        if FREEZES.look() > now - sample.delay:
            return "it waited while this process was frozen"
        return f"it came more than {LATE:g} s late: its link is slow, or was cut"
