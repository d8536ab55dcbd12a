"""A path of straight pieces, by arc length: plain floats, which are faster than numpy for a few points."""

import math
from bisect import bisect_right
from collections.abc import Iterable

from zteam.geometry import Pose2

_LEAST = 1e-9
"""Metres: a nearer point is the same point, because its direction would be rounding."""
_SPARE = 64
"""Points that may lie before what was dropped: they are removed together."""


class Polyline:
    """Points joined by straight pieces. It grows at its end and can be dropped from its beginning.

    Places on it are arc lengths from its first point, in metres. They stay the same when its beginning is dropped.
    """

    def __init__(self, points: Iterable[tuple[float, float]] = ()) -> None:
        self._x: list[float] = []
        self._y: list[float] = []
        self._s: list[float] = []
        self.start = 0.0
        """The place of its beginning: above 0 once something was dropped."""
        self.end = 0.0
        """The place of its last point."""
        for x, y in points:
            self.append(x, y)

    def __len__(self) -> int:
        """The number of its points."""
        return len(self._s)

    @property
    def last(self) -> tuple[float, float]:
        """Its last point. Raises IndexError without one."""
        return self._x[-1], self._y[-1]

    def append(self, x: float, y: float) -> None:
        """Go on straight to this point."""
        if self._s:
            step = math.hypot(x - self._x[-1], y - self._y[-1])
            if step < _LEAST:
                return
            self.end += step
        self._x.append(x)
        self._y.append(y)
        self._s.append(self.end)

    def drop_before(self, s: float) -> None:
        """Forget what lies before `s`, but for the last piece."""
        self.start = max(self.start, min(s, self.end))
        count = self._piece(self.start)
        if count > _SPARE:
            del self._x[:count], self._y[:count], self._s[:count]

    def cut_after(self, s: float) -> None:
        """Forget what lies behind `s`, which becomes its end."""
        if not self._s or s >= self.end:
            return
        x, y, _yaw = self.at(s)
        keep = max(1, bisect_right(self._s, max(s, self.start)))
        del self._x[keep:], self._y[keep:], self._s[keep:]
        self.end = self._s[-1]
        self.append(x, y)

    def at(self, s: float) -> Pose2:
        """The point at `s` and the direction of the path there; its beginning or its end where `s` is beyond.

        Raises IndexError without a point.
        """
        xs, ys, places = self._x, self._y, self._s
        if len(places) < 2:
            return Pose2(xs[0], ys[0], 0.0)
        s = min(max(s, self.start), self.end)
        piece = self._piece(s)
        x, y, begin = xs[piece], ys[piece], places[piece]
        dx, dy = xs[piece + 1] - x, ys[piece + 1] - y
        share = (s - begin) / (places[piece + 1] - begin)
        return Pose2(x + share * dx, y + share * dy, math.atan2(dy, dx))

    def point(self, s: float) -> tuple[float, float]:
        """The point at `s`, as `at`, for less time. Raises IndexError without a point."""
        if len(self._s) < 2:
            return self._x[0], self._y[0]
        s = min(max(s, self.start), self.end)
        return self._point(self._piece(s), s)

    def project(self, x: float, y: float, low: float = -math.inf, high: float = math.inf) -> float:
        """The place nearest to this point, of those from `low` to `high`; the first of equally near ones.

        Raises IndexError without a point.
        """
        xs, ys, places = self._x, self._y, self._s
        low = min(max(low, self.start), self.end)
        high = min(max(high, low), self.end)
        if len(places) < 2:
            return places[0]
        first, last = self._piece(low), self._piece(high)
        (from_x, from_y), (last_x, last_y) = self._point(first, low), self._point(last, high)
        first, last = first + 1, last + 1
        begin, best, nearest = low, low, math.inf
        for to_x, to_y, end in zip(
            (*xs[first:last], last_x), (*ys[first:last], last_y), (*places[first:last], high), strict=True
        ):
            ex, ey = to_x - from_x, to_y - from_y
            off_x, off_y = x - from_x, y - from_y
            along, square, share = off_x * ex + off_y * ey, ex * ex + ey * ey, 0.0
            if along > 0.0:
                share = along / square if along < square else 1.0
                off_x, off_y = off_x - share * ex, off_y - share * ey
            off = off_x * off_x + off_y * off_y
            if off < nearest:
                nearest, best = off, begin + share * (end - begin)
            from_x, from_y, begin = to_x, to_y, end
        return best

    def _point(self, piece: int, s: float) -> tuple[float, float]:
        """The point at `s`, which lies on this piece: as `at`."""
        x, y, begin = self._x[piece], self._y[piece], self._s[piece]
        share = (s - begin) / (self._s[piece + 1] - begin)
        return x + share * (self._x[piece + 1] - x), y + share * (self._y[piece + 1] - y)

    def _piece(self, s: float) -> int:
        """The index of the point at which the piece around `s` begins."""
        return max(0, min(bisect_right(self._s, s) - 1, len(self._s) - 2))
