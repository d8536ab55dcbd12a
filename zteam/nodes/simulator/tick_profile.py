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
        self.last = dict.fromkeys(_ORDER, 0.0)
        """Seconds by phase in the last whole tick."""
        self.start()

    def start(self) -> None:
        """Sum from here on."""
        self._since = monotonic()
        self._tick, self._total = dict.fromkeys(_ORDER, 0.0), dict.fromkeys(_ORDER, 0.0)
        self._ticks = 0

    def end(self, phase: str) -> None:
        """Add the time since the last call to this phase."""
        now = monotonic()
        self._tick[phase] += now - self._since
        self._since = now

    def end_tick(self) -> None:
        """End the tick."""
        self.last, self._tick = self._tick, dict.fromkeys(_ORDER, 0.0)
        self._ticks += 1
        for phase, seconds in self.last.items():
            self._total[phase] += seconds

    def timing(self) -> Timing:
        """Milliseconds a tick on average, by phase."""
        return Timing(**{phase: 1e3 * seconds / max(1, self._ticks) for phase, seconds in self._total.items()})

    def last_text(self) -> str:
        """The last tick in words, without its idle time."""
        parts = [f"{phase} {1e3 * self.last[phase]:.1f} ms" for phase in _ORDER if phase != IDLE]
        return ", ".join(part for part in parts if not part.endswith(" 0.0 ms"))
