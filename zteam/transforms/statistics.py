"""Figures of a stream of transforms: the rate, delay and jitter of each frame."""

from collections import deque
from collections.abc import Collection, Iterable

import msgspec
import numpy as np

from zteam.messages import TransformStamped, ns_from_time

WINDOW = 1000
"""The figures of a frame are computed from this many of its newest samples."""


class FrameFigures(msgspec.Struct):
    """The figures of one child frame in seconds and Hz; None if there were too few samples."""

    parent: str
    child: str
    count: int
    rate: float | None
    """Computed from the stamps."""
    jitter: float | None
    """Standard deviation of the time between stamps."""
    mean_delay: float | None
    """Arrival minus stamp, by the team's clock."""
    max_delay: float | None


class TransformWatch:
    """Computes figures of a stream of transforms. Its memory does not grow with their number."""

    def __init__(self) -> None:
        self._newest: dict[str, tuple[str, deque[tuple[int, int]]]] = {}
        """By child frame: its parent, and the stamp (ns) and arrival of its newest samples; arrival 0 is not known."""

    def take(self, transforms: Iterable[TransformStamped], now: int) -> None:
        """Count transforms that arrived when the team's clock was `now` (ns; 0 = not known yet)."""
        for transform in transforms:
            child = transform.child_frame_id
            _, samples = self._newest.get(child, ("", deque[tuple[int, int]](maxlen=WINDOW)))
            self._newest[child] = transform.header.frame_id, samples
            samples.append((ns_from_time(transform.header.stamp), now))

    def figures(self) -> list[FrameFigures]:
        """The figures of every frame so far, sorted by name."""
        return [_figures(parent, child, samples) for child, (parent, samples) in sorted(self._newest.items())]


def _figures(parent: str, child: str, samples: Collection[tuple[int, int]]) -> FrameFigures:
    gaps = np.diff(sorted(stamp for stamp, _ in samples)) / 1e9
    # The simulator publishes a tick's clock after its transforms: these arrive in time, not early.
    delays = [max(0, now - stamp) / 1e9 for stamp, now in samples if now]
    return FrameFigures(
        parent,
        child,
        len(samples),
        rate=1.0 / float(gaps.mean()) if gaps.any() else None,
        jitter=float(gaps.std()) if gaps.size else None,
        mean_delay=sum(delays) / len(delays) if delays else None,
        max_delay=max(delays, default=None),
    )
