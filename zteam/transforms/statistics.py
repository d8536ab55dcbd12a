"""Figures of a stream of transforms: the rate, delay and jitter of each frame."""

from collections import defaultdict, deque
from collections.abc import Iterable

import msgspec
import numpy as np

from zteam.messages import TransformStamped, ns_from_time

WINDOW = 1000
"""The jitter of a frame is computed from this many of its newest samples."""


class FrameFigures(msgspec.Struct):
    """The figures of one child frame in seconds and Hz; None if there were too few samples."""

    parent: str
    child: str
    count: int
    rate: float | None
    """Computed from the stamps."""
    jitter: float | None
    """Standard deviation of the time between stamps, of the last `WINDOW`."""
    mean_delay: float | None
    """Arrival minus stamp, by the team's clock."""
    max_delay: float | None


class _Stream:
    """The sums and newest stamps (ns) of one child frame; their memory is bounded."""

    parent = ""
    count = oldest = newest = delays = 0
    total_delay = max_delay = 0.0

    def __init__(self) -> None:
        self.recent = deque[int](maxlen=WINDOW)

    def take(self, stamp: int, now: int) -> None:
        self.oldest = min(self.oldest, stamp) if self.count else stamp
        self.newest = max(self.newest, stamp)
        self.count += 1
        self.recent.append(stamp)
        if now:
            # The simulator publishes a tick's clock after its transforms: these arrive in time, not early.
            delay = max(0, now - stamp) / 1e9
            self.delays += 1
            self.total_delay += delay
            self.max_delay = max(self.max_delay, delay)

    def figures(self, child: str) -> FrameFigures:
        span = (self.newest - self.oldest) / 1e9
        gaps = np.diff(np.sort(self.recent)) / 1e9
        return FrameFigures(
            self.parent,
            child,
            self.count,
            rate=(self.count - 1) / span if span > 0.0 else None,
            jitter=float(gaps.std()) if gaps.size else None,
            mean_delay=self.total_delay / self.delays if self.delays else None,
            max_delay=self.max_delay if self.delays else None,
        )


class TransformWatch:
    """Computes figures of a stream of transforms. Its memory does not grow with their number."""

    def __init__(self) -> None:
        self._streams = defaultdict[str, _Stream](_Stream)

    def take(self, transforms: Iterable[TransformStamped], now: int) -> None:
        """Count transforms that arrived when the team's clock was `now` (ns; 0 = not known yet)."""
        for transform in transforms:
            stream = self._streams[transform.child_frame_id]
            stream.parent = transform.header.frame_id
            stream.take(ns_from_time(transform.header.stamp), now)

    def figures(self) -> list[FrameFigures]:
        """The figures of every frame so far, sorted by name."""
        return [stream.figures(child) for child, stream in sorted(self._streams.items())]
