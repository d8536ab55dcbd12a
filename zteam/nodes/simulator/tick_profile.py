"""Where a tick's time goes, measured on the host's clock."""

from zteam.clock import monotonic

WAIT, IDLE, PHYSICS, SENSORS, PUBLISH = "wait", "idle", "physics", "sensors", "publish"
"""For answers; for the next tick to be due; bodies and odometry; lasers; messages made and sent."""
_ORDER = (WAIT, PHYSICS, SENSORS, PUBLISH, IDLE)


class TickProfile:
    """Sums of seconds by phase: of the last whole tick, and since `start`."""

    def __init__(self) -> None:
        self._since = monotonic()
        self._tick = dict.fromkeys(_ORDER, 0.0)
        self.last = dict(self._tick)
        self._total = dict(self._tick)
        self._ticks = 0

    def start(self) -> None:
        """Sum from here on."""
        self._since = monotonic()
        self._tick, self._total, self._ticks = dict.fromkeys(_ORDER, 0.0), dict.fromkeys(_ORDER, 0.0), 0

    def end(self, phase: str) -> None:
        """What happened since the last call was this."""
        now = monotonic()
        self._tick[phase] += now - self._since
        self._since = now

    def end_tick(self) -> None:
        """A tick is over."""
        self.last, self._tick = self._tick, dict.fromkeys(_ORDER, 0.0)
        self._ticks += 1
        for phase, seconds in self.last.items():
            self._total[phase] += seconds

    def mean_ms(self) -> dict[str, float]:
        """Milliseconds a tick, by phase."""
        return {phase: 1e3 * seconds / max(1, self._ticks) for phase, seconds in self._total.items()}

    def last_text(self) -> str:
        """The last tick in words, without what it idled."""
        parts = [f"{phase} {1e3 * self.last[phase]:.1f} ms" for phase in _ORDER if phase != IDLE]
        return ", ".join(part for part in parts if not part.endswith(" 0.0 ms"))
