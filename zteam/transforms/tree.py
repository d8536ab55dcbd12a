"""The tree of frames: samples of edges, paths, and tf2's reasons to refuse. Callers hold the buffer's lock."""

import math
from bisect import bisect_left
from cmath import sqrt
from collections.abc import Container, Sequence
from typing import NamedTuple

import msgspec

from zteam.names import strip_slash
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
        if samples[0][0] < self.newest - cache:
            del samples[: bisect_left(samples, (self.newest - cache,))]

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


class Tree:
    """All edges."""

    def __init__(self, cache: int) -> None:
        """`cache` is how long moving frames are remembered, in ns."""
        self.cache, self.duplicates = cache, 0
        self.edges: dict[str, TimeCache] = {}
        """By child frame."""
        self._paths: dict[tuple[str, str], FramePath] = {}
        """By target and source; cleared if a frame, a parent or a static transform changes."""
        self._frames: set[str] = set()
        """Every frame that was ever a child or a parent."""

    def add(self, child: str, parent: str, stamp: int, floats: Floats, authority: str) -> Rejection | None:
        """`put` a moving sample, in short where it is a usual one."""
        edge = self.edges.get(child)
        if edge is not None and edge.parent == parent and not edge.static:
            x, y, z, i, j, k, w = floats
            # A newer one, with a unit quaternion and finite numbers: NaN or inf would make the sum NaN.
            if edge.newest < stamp:
                if -ROUNDING < i * i + j * j + k * k + w * w - 1.0 + (x + y + z) * 0.0 < ROUNDING:
                    edge.insert(stamp, edge.parent, floats, self.cache)
                    edge.authority = authority
                    return None
            # What is sent again.
            elif edge.samples[-1] == (stamp, parent, floats):
                self.duplicates += 1
                return None
        return self.put(child, parent, stamp, floats, authority)

    def put(
        self, child: str, parent: str, stamp: int, floats: Floats, authority: str, *, static: bool = False
    ) -> Rejection | None:
        """Store a sample, or a static transform; None, or why it was refused. Names may have a leading slash."""
        child, parent = strip_slash(child), strip_slash(parent)
        refused = _check(parent, child, floats, authority)
        if refused is not None:
            return refused
        floats = _normalise(floats)
        edge = self.edges.get(child)
        if edge is not None and edge.parent and not static:
            if edge.static:
                text = f"{child} is static by {edge.authority}: {authority}'s sample is refused"
                return Rejection("TF_STATIC_FRAME", text)
            if edge.newest > stamp + self.cache:
                text = f"{child} from {authority} is older than the cache of {self.cache / 1e9} s"
                return Rejection("TF_OLD_DATA", text)
            known = edge.find(stamp)
            if known == (stamp, parent, floats):
                self.duplicates += 1
                return None
            if known is not None:
                return Rejection("TF_REPEATED_DATA", f"{child} has a sample of {stamp / 1e9:.9f} s already")
        if (edge is None or edge.parent != parent) and child in self.chain(parent):
            other = self.edges[parent].authority if parent in self.edges else authority
            return Rejection("TF_LOOP", f"{parent} -> {child} by {authority} closes a loop with {other}'s transforms")
        if edge is None or not edge.parent or static:
            edge = self.edges[child] = TimeCache(static)
        if edge.parent != parent or static:
            self._paths.clear()
        edge.insert(stamp, parent, floats, self.cache)
        edge.authority = authority
        self._frames.update((child, parent))
        return None

    def chain(self, frame: str) -> list[str]:
        """A frame and its ancestors, by the newest parents."""
        found = [frame]
        # This ends: a sample that would close a loop with the newest parents is refused.
        while (edge := self.edges.get(found[-1])) is not None and edge.parent:
            found.append(edge.parent)
        return found

    def forget(self, child: str) -> None:
        if self.edges.pop(child, None) is not None:
            self._paths.clear()

    def clear(self) -> None:
        for child, edge in self.edges.items():
            if not edge.static:
                self.edges[child] = TimeCache()
        self._paths.clear()

    def latest(self, target: str, source: str) -> int:
        """The newest time that all moving edges between two frames have; raises where they are not connected."""
        path = self._paths.get((target, source)) or self._prepare(target, source)
        if path is not None:
            return path.newest
        if target != source:
            return FramePath(*self._find_edges(target, source)).newest
        edge = self.edges.get(target)
        return edge.newest if edge is not None else 0

    def check_frames(self, **arguments: str) -> None:
        """Raise InvalidArgumentException or LookupException for names that no frame has."""
        for argument, name in arguments.items():
            what = f"passed to lookupTransform argument {argument}"
            if not name:
                raise errors.InvalidArgumentException(f"Invalid argument {what} in tf2 frame_ids cannot be empty")
            if name.startswith("/"):
                raise errors.InvalidArgumentException(
                    f"Invalid argument \"{name}\" {what} in tf2 frame_ids cannot start with a '/' like: "
                )
        for argument, name in arguments.items():
            if name not in self._frames:
                raise errors.LookupException(f'"{name}" passed to lookupTransform argument {argument} does not exist. ')

    def solve(self, target: str, source: str, time: int) -> Answer:
        """target_from_source at `time` (0 = the newest that all moving edges have); raises tf2's exceptions."""
        path = self._paths.get((target, source)) or self._prepare(target, source, time)
        answer = path.solve(time or path.newest) if path is not None else None
        if answer is not None:
            return answer
        time = time or self.latest(target, source)
        if target == source:
            return (time, *IDENTITY)
        # The parents at that time may differ from the newest ones. Where an edge has no data, this raises.
        answer = FramePath(*self._find_edges(target, source, time)).solve(time)
        assert answer is not None
        return answer

    def _prepare(self, target: str, source: str, time: int = 0) -> FramePath | None:
        """The path by the newest parents; None if it does not hold at every time, or if there is one at times only."""
        if target == source:
            return None
        self.check_frames(target_frame=target, source_frame=source)
        try:
            up, down = self._find_edges(target, source)
        except errors.ConnectivityException:
            if not time:
                raise
            return None
        if any(parent != edge.parent for edge in (*up, *down) for _, parent, _ in edge.samples):
            # At other times the path was another one.
            return None
        path = self._paths[target, source] = FramePath(up, down)
        return path

    def _find_edges(self, target: str, source: str, time: int | None = None) -> tuple[list[TimeCache], list[TimeCache]]:
        """The edges up to the common ancestor, by the newest parents or those at `time`. Raises tf2's exceptions."""
        failures: list[errors.ExtrapolationException] = []

        def parent_of(frame: str) -> str:
            edge = self.edges.get(frame)
            if edge is None or time is None or edge.static:
                return edge.parent if edge is not None else ""
            if failure := _extrapolation(edge.samples, time, f"from frame [{source}] to frame [{target}]"):
                failures.append(failure)
                return ""
            return edge.samples[edge.before(time)][1]

        def climb(frame: str, ends: Container[str]) -> list[str]:
            found = [frame]
            while found[-1] not in ends and (parent := parent_of(found[-1])):
                found.append(parent)
                # The newest parents never form a loop, but parents at different times can.
                if len(found) > len(self.edges) + 1:
                    raise errors.LookupException("The tf tree is invalid because it contains a loop.")
            return found

        up = climb(source, ())
        down = climb(target, set(up))
        if down[-1] not in up:
            if failures:
                raise failures[-1]
            raise errors.ConnectivityException(
                f"Could not find a connection between '{target}' and '{source}' because they are not part of "
                "the same tree.Tf has two or more unconnected trees."
            )
        return [self.edges[f] for f in up[: up.index(down[-1])]], [self.edges[f] for f in down[:-1]]


def _extrapolation(samples: Sequence[Sample], time: int, leg: str) -> errors.ExtrapolationException | None:
    """tf2's exception for a time for which a moving edge has no data."""
    end = f", when looking up transform {leg}"
    if not samples:
        return errors.NoDataForExtrapolationException(f"Lookup would require data, but the buffer was cleared{end}")
    first, last = samples[0][0], samples[-1][0]
    if first <= time <= last:
        return None
    begin = "Lookup would require extrapolation"
    if first == last:
        text = f"{begin} at time {_seconds(time)}, but only time {_seconds(first)} is in the buffer{end}"
        return errors.NoDataForExtrapolationException(text)
    is_late = time > last
    which, known, to = ("latest", last, "into the future") if is_late else ("earliest", first, "into the past")
    text = (
        f"{begin} {_seconds(abs(time - known))}s {to}.  Requested time {_seconds(time)} but the {which} data is at time"
    )
    kind = errors.ForwardExtrapolationException if is_late else errors.BackwardExtrapolationException
    return kind(f"{text} {_seconds(known)}{end}")


def _seconds(nanoseconds: int) -> str:
    """Nanoseconds as seconds with nine decimals; a double does not have enough digits for that."""
    whole, rest = divmod(nanoseconds, 10**9)
    return f"{whole}.{rest:09d}"


def _check(parent: str, child: str, floats: Floats, authority: str) -> Rejection | None:
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


def _normalise(floats: Floats) -> Floats:
    """The same transform with its quaternion scaled to length 1."""
    x, y, z, i, j, k, w = floats
    square = i * i + j * j + k * k + w * w
    if abs(square - 1.0) < ROUNDING:
        return floats
    scale = square**-0.5
    return (x, y, z, i * scale, j * scale, k * scale, w * scale)
