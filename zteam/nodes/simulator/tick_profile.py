"""What a tick's time is spent on, measured on the host's clock."""

from zteam.clock import monotonic
from zteam.services.simulator import Timing

WAIT, IDLE, PHYSICS, SENSORS, PUBLISH = "wait", "idle", "physics", "sensors", "publish"
"""Phases: waiting for answers; waiting until the next tick is due; bodies and odometry; lasers; making and sending
messages."""
_ORDER = (WAIT, PHYSICS, SENSORS, PUBLISH, IDLE)


class TickProfile:
    """Sums of seconds by phase: of the last whole tick, and since `start`."""

    def __init__(self) -> None:
        self._before = self._after = dict.fromkeys(_ORDER, 0.0)
        """The sums before and after the last whole tick."""
        self.start()

    def start(self) -> None:
        """Sum from here on."""
        self._since = monotonic()
        self._sums = dict.fromkeys(_ORDER, 0.0)
        self._before = self._after = self._sums.copy()
        self._ticks = 0

    def end(self, phase: str) -> None:
        """Add the time since the last call to this phase."""
        now = monotonic()
        self._sums[phase] += now - self._since
        self._since = now

    def end_tick(self) -> None:
        """End the tick."""
        self._before, self._after = self._after, self._sums.copy()
        self._ticks += 1

    @property
    def last(self) -> dict[str, float]:
        """Seconds by phase in the last whole tick."""
        return {phase: self._after[phase] - self._before[phase] for phase in _ORDER}

    def timing(self) -> Timing:
        """Milliseconds a tick on average, by phase."""
        return Timing(**{phase: 1e3 * seconds / max(1, self._ticks) for phase, seconds in self._after.items()})

    def last_text(self) -> str:
        """The last tick in words, without its idle time."""
        parts = [f"{phase} {1e3 * seconds:.1f} ms" for phase, seconds in self.last.items() if phase != IDLE]
        return ", ".join(part for part in parts if not part.endswith(" 0.0 ms"))
