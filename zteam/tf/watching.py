"""Figures of a stream of transforms: how often, how late, how evenly each frame comes."""

import itertools
import math
from collections.abc import Iterable

import msgspec

from zteam.messages import TransformStamped, ns_from_time


class FrameFigures(msgspec.Struct):
    """One child frame; seconds and Hz. None where there were too few samples."""

    parent: str
    child: str
    count: int
    rate: float | None
    """By the stamps."""
    jitter: float | None
    """Standard deviation of the time between stamps."""
    mean_delay: float | None
    """Arrival minus stamp, by the team's clock."""
    max_delay: float | None


class Watch:
    """Counts what it is shown."""

    def __init__(self) -> None:
        self._parents: dict[str, str] = {}
        self._stamps: dict[str, list[int]] = {}
        self._delays: dict[str, list[float]] = {}

    def take(self, transforms: Iterable[TransformStamped], now: int) -> None:
        """Transforms that arrived when the team's clock read `now` (ns; 0 = it has not spoken)."""
        for transform in transforms:
            child, stamp = transform.child_frame_id, ns_from_time(transform.header.stamp)
            self._parents[child] = transform.header.frame_id
            self._stamps.setdefault(child, []).append(stamp)
            if now:
                # A simulator's clock leaves after the transforms of its tick: those are in time, not early.
                self._delays.setdefault(child, []).append(max(0, now - stamp) / 1e9)

    def figures(self) -> list[FrameFigures]:
        """Of every frame seen, by name."""
        return [self._figures_of(child) for child in sorted(self._stamps)]

    def _figures_of(self, child: str) -> FrameFigures:
        stamps, delays = sorted(self._stamps[child]), self._delays.get(child, [])
        gaps = [(b - a) / 1e9 for a, b in itertools.pairwise(stamps)]
        mean = sum(gaps) / len(gaps) if gaps else 0.0
        spread = math.sqrt(sum((gap - mean) ** 2 for gap in gaps) / len(gaps)) if gaps else None
        return FrameFigures(
            self._parents[child],
            child,
            len(stamps),
            1.0 / mean if mean > 0.0 else None,
            spread,
            sum(delays) / len(delays) if delays else None,
            max(delays, default=None),
        )
