"""Real-time pacing of the simulator's ticks: never skips one, measures how far it falls behind."""

from collections import deque

from zteam.clock import monotonic
from zteam.nodes.node import Node

_WINDOW = 50
"""Ticks over which the real-time factor is measured."""
_MAX_LAG = 1.0
"""Seconds behind schedule after which the schedule starts anew instead of rushing to catch up."""


class Pacer:
    """Says when the next tick is due."""

    def __init__(self, interval: int) -> None:
        self._interval = interval / 1e9
        self._due: float | None = None
        self._starts: deque[float] = deque(maxlen=_WINDOW)
        self.busy = 0.0
        """Seconds that the last tick took."""

    def wait(self, node: Node) -> bool:
        """Wait for the next tick; False when the process is asked to stop."""
        now = monotonic()
        if self._starts:
            self.busy = now - self._starts[-1]
        due = now if self._due is None or now - self._due > _MAX_LAG else self._due
        # Anything that wakes the node would end a bare wait early, so the condition is the time itself.
        node.wait(lambda: monotonic() >= due, max(0.0, due - now))
        self._due = due + self._interval
        self._starts.append(monotonic())
        return not node.stopping

    @property
    def factor(self) -> float:
        """Simulated seconds a second of the host over the last ticks; 1 until that is known."""
        if len(self._starts) < 2:
            return 1.0
        elapsed = self._starts[-1] - self._starts[0]
        return self._interval * (len(self._starts) - 1) / elapsed if elapsed > 0 else 1.0
