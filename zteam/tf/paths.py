"""A path between two frames, prepared once: consecutive static transforms are composed, planar edges stay planar.

A path is valid as long as every edge on it keeps its parent and its form; the tree drops its paths when that changes.
`solve` returns None if an edge has no data at that time, only samples older than the cache, or stamps of 0. The tree
then searches without the path, and raises the right exception.

Callers hold the buffer's lock.
"""

from bisect import bisect_right
from cmath import phase, rect, sqrt
from collections.abc import Sequence
from math import atan2
from typing import NamedTuple

from zteam.geometry import Pose2
from zteam.tf.rigid import IDENTITY, Floats, compose, interpolate, invert
from zteam.tf.time_cache import TimeCache, is_planar, pack

Answer = tuple[int, float, float, float, float, float, float, float]
"""Stamp in ns and x, y, z, qx, qy, qz, qw of target_from_source."""

Planar = tuple[complex, complex, float]
"""A planar sample: place and turn (see `pack`), and z."""


def read_planar(numbers: Sequence[float]) -> Planar | None:
    """A transform's seven numbers as a planar sample; None if they are not ones that a buffer stores as they are."""
    x, y, z, i, j, k, w = numbers
    # The test of `Buffer.set_transform`.
    if not i and not j and 0.999999999999999 < k * k + w * w + (x + y) * 0.0 < 1.000000000000001:
        half = complex(w, k)
        return complex(x, y), half * half, z
    return None


class Legs(NamedTuple):
    """Edges from two frames up to their common ancestor."""

    source: tuple[TimeCache, ...]
    target: tuple[TimeCache, ...]


class _Step(NamedTuple):
    edge: TimeCache
    down: bool
    """Whether the path leads from the parent to the child, not from the child to the parent."""
    after: Floats
    """The product of the static transforms between this edge and the next moving one."""


class ConstantPath:
    """A path without a moving edge."""

    __slots__ = ("_floats",)

    def __init__(self, floats: Floats) -> None:
        self._floats = floats

    def solve(self, time: int) -> Answer | None:
        """The answer at `time`: the transform is the same at every time."""
        return (time, *self._floats)


class PlanarPath:
    """A path whose edges all rotate about z only."""

    __slots__ = ("_cache", "_edges", "_first", "_place", "_steps", "_turn", "_z")

    def __init__(self, first: Floats, steps: Sequence[_Step], cache: int) -> None:
        self._cache = cache
        self._first = steps[0].edge
        self._edges = [step.edge for step in steps[1:]]
        self._place, self._turn, self._z = _planar(first)
        self._steps: list[tuple[TimeCache, bool, complex | None, complex]] = []
        for edge, down, after in steps:
            place, turn, z = _planar(after)
            self._z += z - edge.z if down else z + edge.z
            self._steps.append((edge, down, None if after == IDENTITY else place, turn))

    def solve(self, time: int) -> Answer | None:
        """The answer at `time` (0 = the newest that all edges have)."""
        if not time:
            time = self._first.newest
            for edge in self._edges:
                if edge.newest < time:
                    time = edge.newest
            if time <= 0:
                return None
        place, turn = self._place, self._turn
        for edge, down, shift, after in self._steps:
            if edge.fresh:
                edge.settle()
            stamps, places, turns = edge.settled
            at = len(stamps) - 1
            until = stamps[at]
            if until == time:
                p, h = places[at], turns[at]
            else:
                stamp = stamps[at - 1]
                if stamp > time:
                    at = bisect_right(stamps, time)
                    stamp = stamps[at - 1]
                    if not at or stamp < until - self._cache:
                        return None
                elif until < time:
                    return None
                p, h = places[at - 1], turns[at - 1]
                if stamp != time:
                    q, g = places[at], turns[at]
                    # Slerp is slow, and a robot that drives straight ahead or stands still does not need it.
                    if g != h:
                        part = (time - stamp) / (stamps[at] - stamp)
                        p += (q - p) * part
                        h *= rect(1.0, part * phase(g / h))
                    elif q != p:
                        p += (q - p) * ((time - stamp) / (stamps[at] - stamp))
            if down:
                place = (place - p) / h
                turn /= h
            else:
                place = p + h * place
                turn *= h
            if shift is not None:
                place = shift + after * place
                turn *= after
        half = sqrt(turn)
        return time, place.real, place.imag, self._z, 0.0, 0.0, half.imag, half.real

    @property
    def edges(self) -> list[TimeCache]:
        """Its moving edges, in the order in which it leads over them."""
        return [self._first, *self._edges]

    @property
    def rule(self) -> "PlanarRule":
        """How a pose follows from samples of its moving edges."""
        steps = tuple((edge.z, down, shift, after) for edge, down, shift, after in self._steps)
        return PlanarRule(self._place, self._turn, steps)


class PlanarRule(NamedTuple):
    """How a planar path makes a pose of one sample of each edge. It knows no edge: those of equal paths are equal."""

    place: complex
    turn: complex
    steps: tuple[tuple[float, bool, complex | None, complex], ...]
    """For each edge its z, whether the path leads down it, and the place and the turn behind it."""

    def pose(self, samples: Sequence[Planar | None]) -> Pose2 | None:
        """What `solve` answers if these are the samples of the edges, in the order of `edges`, at that time.

        None if a sample is not planar, or does not fit its edge.
        """
        place, turn, steps = self
        for sample, (z, down, shift, after) in zip(samples, steps, strict=True):
            if sample is None or sample[2] != z:
                return None
            p, h, _ = sample
            # The steps of `solve`, written out again: a call for each would slow every look-up down.
            if down:
                place = (place - p) / h
                turn /= h
            else:
                place = p + h * place
                turn *= h
            if shift is not None:
                place = shift + after * place
                turn *= after
        half = sqrt(turn)
        w, z = half.real, half.imag
        # As `yaw_from_quaternion`, to the last bit.
        return Pose2(place.real, place.imag, atan2(2.0 * (w * z + 0.0), 1.0 - 2.0 * (0.0 + z * z)))


def _planar(floats: Floats) -> tuple[complex, complex, float]:
    return (*pack(floats), floats[2])


class SpatialPath:
    """A path with an edge that also rotates about another axis than z."""

    __slots__ = ("_cache", "_edges", "_first", "_steps")

    def __init__(self, first: Floats, steps: Sequence[_Step], cache: int) -> None:
        self._cache = cache
        self._edges = [step.edge for step in steps]
        self._first = first
        self._steps = [(edge, down, None if after == IDENTITY else after) for edge, down, after in steps]

    def solve(self, time: int) -> Answer | None:
        """The answer at `time` (0 = the newest that all edges have)."""
        if not time:
            time = min([edge.newest for edge in self._edges])
            if time <= 0:
                return None
        floats = self._first
        for edge, down, after in self._steps:
            moving = find_floats(edge, time, self._cache)
            if moving is None:
                return None
            floats = compose(invert(moving) if down else moving, floats)
            if after is not None:
                floats = compose(after, floats)
        return (time, *floats)


Path = ConstantPath | PlanarPath | SpatialPath


def find_floats(edge: TimeCache, time: int, cache: int) -> Floats | None:
    """The transform of a moving edge with one parent at `time`; None outside of its history."""
    stamps = edge.history[0]
    last = stamps[-1]
    at = bisect_right(stamps, time)
    if not at or time > last or stamps[at - 1] < last - cache:
        return None
    stamp = stamps[at - 1]
    older = edge.floats_of(at - 1)
    if stamp == time:
        return older
    return interpolate(older, edge.floats_of(at), (time - stamp) / (stamps[at] - stamp))


def prepare_path(legs: Legs, cache: int) -> Path:
    """Prepare the path along edges that have one parent each."""
    first, steps = IDENTITY, list[_Step]()
    for edge, down in [(edge, False) for edge in legs.source] + [(edge, True) for edge in reversed(legs.target)]:
        if not edge.static:
            steps.append(_Step(edge, down, IDENTITY))
            continue
        floats = invert(edge.floats_of(0)) if down else edge.floats_of(0)
        if steps:
            steps[-1] = steps[-1]._replace(after=compose(floats, steps[-1].after))
        else:
            first = compose(floats, first)
    if not steps:
        return ConstantPath(first)
    planar = is_planar(first) and all(step.edge.planar and is_planar(step.after) for step in steps)
    return PlanarPath(first, steps, cache) if planar else SpatialPath(first, steps, cache)
