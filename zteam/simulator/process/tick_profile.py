"""Where a tick's host time goes."""

from zteam.clock import monotonic
from zteam.simulator.client import Timing

WAIT, IDLE, PHYSICS, SENSORS, PUBLISH = "wait", "idle", "physics", "sensors", "publish"
"""Phases: waiting for answers; waiting until the next tick is due; bodies and odometry; lasers; making and sending
messages."""
_ORDER = (WAIT, PHYSICS, SENSORS, PUBLISH, IDLE)


class TickProfile:
    """Seconds by phase: of the last whole tick, and of all whole ticks since `start`."""

    def __init__(self) -> None:
        self._last = _no_time()
        self.start()

    def start(self) -> None:
        """Sum from here on."""
        self._since = monotonic()
        self._open, self._sums, self._ticks = _no_time(), _no_time(), 0

    def end(self, phase: str) -> None:
        """Add the time since the last call to this phase."""
        now = monotonic()
        self._open[phase] += now - self._since
        self._since = now

    def end_tick(self) -> None:
        self._last, self._open = self._open, _no_time()
        self._sums = {phase: seconds + self._last[phase] for phase, seconds in self._sums.items()}
        self._ticks += 1

    def timing(self) -> Timing:
        """Milliseconds a tick on average, by phase."""
        return Timing(**{phase: 1e3 * seconds / max(1, self._ticks) for phase, seconds in self._sums.items()})

    def last_text(self) -> str:
        """The last tick in words, without its idle time."""
        parts = [(phase, s) for phase, s in self._last.items() if phase != IDLE and s >= 5e-5]
        return ", ".join(f"{phase} {1e3 * s:.1f} ms" for phase, s in parts)


def _no_time() -> dict[str, float]:
    return dict.fromkeys(_ORDER, 0.0)
