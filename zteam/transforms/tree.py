"""Edges of the tree of frames, paths over them, and tf2's reasons to refuse. Callers hold the buffer's lock."""

import math
from bisect import bisect_left
from cmath import sqrt
from collections.abc import Sequence
from typing import NamedTuple

import msgspec

from zteam.transforms import errors
from zteam.transforms.rigid import IDENTITY, Floats, compose, interpolate, invert

UNIT_TOLERANCE = 0.01
"""tf2 refuses a quaternion whose squared length is this far from 1."""

ROUNDING = 1e-15
"""A quaternion whose squared length differs from 1 by less than this is not scaled: that is rounding of doubles."""

Answer = tuple[int, float, float, float, float, float, float, float]
"""Stamp in ns and x, y, z, qx, qy, qz, qw of target_from_source."""

Sample = tuple[int, str, Floats]
"""Stamp in ns, parent, parent_from_child."""


class Rejection(NamedTuple):
    """Why a transform was not stored: tf2's code, and a text."""

    code: str
    text: str


class FrameInfo(msgspec.Struct, frozen=True):
    """The figures of one child frame; times in ns, rate in Hz."""

    parent: str
    authority: str
    static: bool
    rate: float
    oldest: int
    newest: int
    samples: int


class TimeCache:
    """The edge from one child frame to its parent: its samples in order of time, or its static transform."""

    __slots__ = ("authority", "newest", "parent", "samples", "static")

    def __init__(self, static: bool = False) -> None:
        self.static = static
        self.samples: list[Sample] = []
        """By ascending stamps; of a static edge one."""
        # Of the newest sample.
        self.authority, self.parent, self.newest = "", "", 0

    def insert(self, stamp: int, parent: str, floats: Floats, cache: int) -> None:
        """Insert a sample whose stamp is new, and forget those that are `cache` ns older than the newest one."""
        samples = self.samples
        if stamp > self.newest or not samples:
            samples.append((stamp, parent, floats))
            self.newest, self.parent = stamp, parent
        else:
            samples.insert(bisect_left(samples, (stamp,)), (stamp, parent, floats))
        oldest = self.newest - cache
        if samples[0][0] < oldest:
            # Nearly always one.
            del samples[: 1 if samples[1][0] >= oldest else bisect_left(samples, (oldest,))]

    def find(self, stamp: int) -> Sample | None:
        """The sample with exactly this stamp."""
        at = bisect_left(self.samples, (stamp,))
        return self.samples[at] if at < len(self.samples) and self.samples[at][0] == stamp else None

    def before(self, time: int) -> int:
        """The index of the newest sample that is not newer than `time`; -1 without one."""
        # A tuple is less than a longer one that begins with it.
        return bisect_left(self.samples, (time + 1,)) - 1

    def at(self, time: int) -> Floats | None:
        """The transform of a moving edge at `time`; None outside of its history."""
        samples = self.samples
        stamp, _, floats = samples[-1]
        if stamp == time:
            return floats
        at = self.before(time)
        if at < 0 or stamp < time:
            return None
        (stamp, parent, older), (end, other, newer) = samples[at], samples[at + 1]
        # Samples with different parents cannot be interpolated: the older one holds until the newer one.
        return older if stamp == time or parent != other else interpolate(older, newer, (time - stamp) / (end - stamp))

    def info(self) -> FrameInfo:
        """Its figures; it has a sample."""
        oldest, newest, count = self.samples[0][0], self.samples[-1][0], len(self.samples)
        rate = 0.0 if newest == oldest else (count - 1) * 1e9 / (newest - oldest)
        return FrameInfo(self.parent, self.authority, self.static, rate, oldest, newest, count)


class FramePath:
    """The path from a source to a target, its static transforms composed; it holds while edges keep their parents."""

    __slots__ = ("_first", "_is_planar", "_moving", "_start", "_steps")

    def __init__(self, up: Sequence[TimeCache], down: Sequence[TimeCache]) -> None:
        """The edges from the source and from the target to their common ancestor."""
        first, steps = IDENTITY, list[tuple[TimeCache, bool, Floats]]()
        for edge, is_down in [(edge, False) for edge in up] + [(edge, True) for edge in reversed(down)]:
            if not edge.static:
                steps.append((edge, is_down, IDENTITY))
                continue
            floats = edge.samples[0][2]
            if is_down:
                floats = invert(floats)
            if steps:
                steps[-1] = (*steps[-1][:2], compose(floats, steps[-1][2]))
            else:
                first = compose(floats, first)
        self._moving = [edge for edge, _, _ in steps]
        self._first, self._start = first, _in_plane(first)
        self._steps = [
            (edge, is_down, after, None if after == IDENTITY else _in_plane(after)) for edge, is_down, after in steps
        ]
        """The moving edges, whether the path leads down each, and the static transform between it and the next one."""
        self._is_planar = not any(floats[3] or floats[4] for floats in (first, *(after for *_, after in steps)))

    @property
    def newest(self) -> int:
        """The newest time (ns) that all moving edges have; 0 if none moves. Stamps of 0 do not count, as in tf2."""
        newest = 0
        for edge in self._moving:
            if not newest or 0 != edge.newest < newest:
                newest = edge.newest
        return newest

    def solve(self, time: int) -> Answer | None:
        """target_from_source at `time`; None if a moving edge has no data for it."""
        if not self._is_planar:
            return self._solve_in_space(time)
        # In the plane, complex numbers need a third of the time.
        place, turn, z = self._start
        for edge, is_down, _, then in self._steps:
            floats = edge.at(time)
            if floats is None:
                return None
            x, y, height, i, j, k, w = floats
            if i or j:
                return self._solve_in_space(time)
            moved, half = complex(x, y), complex(w, k)
            turned = half * half
            if is_down:
                place, turn, z = (place - moved) / turned, turn / turned, z - height
            else:
                place, turn, z = moved + turned * place, turn * turned, z + height
            if then is not None:
                shift, bend, rise = then
                place, turn, z = shift + bend * place, turn * bend, z + rise
        half = sqrt(turn)
        return time, place.real, place.imag, z, 0.0, 0.0, half.imag, half.real

    def _solve_in_space(self, time: int) -> Answer | None:
        floats = self._first
        for edge, is_down, after, _ in self._steps:
            moved = edge.at(time)
            if moved is None:
                return None
            floats = compose(after, compose(invert(moved) if is_down else moved, floats))
        return (time, *floats)


def _in_plane(floats: Floats) -> tuple[complex, complex, float]:
    """The place x + iy, the turn and z of a planar transform, which maps a point p to place + turn * p."""
    half = complex(floats[6], floats[5])
    return complex(floats[0], floats[1]), half * half, floats[2]


def extrapolation(samples: Sequence[Sample], time: int, leg: str) -> errors.ExtrapolationException | None:
    """tf2's exception for a time for which a moving edge has no data; `leg` is between which frames."""
    if not samples:
        return errors.NoDataForExtrapolationException(f"there is no data {leg}: time jumped back, or it was cleared")
    first, last = samples[0][0], samples[-1][0]
    if first <= time <= last:
        return None
    kind: type[errors.ExtrapolationException] = errors.NoDataForExtrapolationException
    if first < last:
        kind = errors.ForwardExtrapolationException if time > last else errors.BackwardExtrapolationException
    return kind(f"there is no data {leg} at {_seconds(time)} s, but from {_seconds(first)} s to {_seconds(last)} s")


def _seconds(nanoseconds: int) -> str:
    """Nanoseconds as seconds with nine decimals; a double does not have enough digits for that."""
    whole, rest = divmod(nanoseconds, 10**9)
    return f"{whole}.{rest:09d}"


def check_sample(parent: str, child: str, floats: Floats, authority: str) -> Rejection | None:
    """Check the names, that all numbers are finite, and that the quaternion is nearly a unit one."""
    if not child:
        return Rejection("TF_NO_CHILD_FRAME_ID", f"a transform from {authority} has no child_frame_id")
    if not parent:
        code, problem = "TF_NO_FRAME_ID", "has no frame_id"
    elif parent == child:
        code, problem = "TF_SELF_TRANSFORM", "is its own parent"
    elif not all(map(math.isfinite, floats)):
        code, problem = "TF_NAN_INPUT", "holds a number that is not finite"
    elif abs(sum(q * q for q in floats[3:]) - 1.0) >= UNIT_TOLERANCE:
        code, problem = "TF_DENORMALIZED_QUATERNION", "has a rotation that is no unit quaternion"
    else:
        return None
    return Rejection(code, f"{child} from {authority} {problem}")


def normalise(floats: Floats) -> Floats:
    """The same transform with its quaternion scaled to length 1."""
    x, y, z, i, j, k, w = floats
    square = i * i + j * j + k * k + w * w
    if abs(square - 1.0) < ROUNDING:
        return floats
    scale = square**-0.5
    return (x, y, z, i * scale, j * scale, k * scale, w * scale)
