"""Pauses between the steps of a process: it was frozen, or nothing asked for a step."""

from zteam.clock import FREEZES, monotonic

PAUSE = 0.5
"""Seconds without a step from which on there was a pause: of its time and, out of lock-step, of the host too."""
_INTERVALS = 3.0
"""The same in intervals of steps, where these are long."""


class Pauses:
    """Whether there was a pause before a step. That a robot did not get on meanwhile does not count."""

    def __init__(self) -> None:
        self._time, self._host = 0, 0.0
        """Of the last step, in ns and in host time; 0 before."""

    def take(self, now: int, interval: float, *, in_lockstep: bool) -> bool:
        """A step begins at time `now` (ns), one comes every `interval` seconds: whether there was a pause before it."""
        before, self._time = self._time, now
        host, self._host = self._host, 0.0 if in_lockstep else monotonic()
        if not 0 < before < now - 1e9 * max(PAUSE, _INTERVALS * interval):
            return False
        # Time that runs at many times the host's has gaps of its own.
        return in_lockstep or self._host - host > PAUSE or FREEZES.look() > host
