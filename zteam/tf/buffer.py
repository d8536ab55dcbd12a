"""The transform buffer: tf2's contract, pure Python, no bus.

Times are integer nanoseconds; 0 means the latest common time. `lookup_transform(target, source, t)` takes data from
`source` into `target`: it is the pose of `source` in `target`. Where this differs from tf2 on purpose, docs/transforms
has the table: quaternions are normalised, inf, NaN and loops are refused when they come, a refused sample leaves no
trace, exact duplicates are counted silently, dynamic data on a static frame is refused, no error text is empty.
"""

import math
import threading
from bisect import bisect_right
from collections.abc import Iterable
from typing import NamedTuple

from zteam.clock import wait_until
from zteam.geometry import Pose2, yaw_from_quaternion
from zteam.messages import (
    Header,
    Quaternion,
    Transform,
    TransformStamped,
    Vector3,
    ns_from_time,
    time_from_ns,
)
from zteam.names import strip_slash
from zteam.tf.errors import (
    BackwardExtrapolationException,
    ConnectivityException,
    ExtrapolationException,
    ForwardExtrapolationException,
    InvalidArgumentException,
    LookupException,
    NoDataForExtrapolationException,
    TransformException,
)
from zteam.tf.samples import IDENTITY, Edge, Floats, Sample, compose, interpolate, invert

DEFAULT_CACHE = 10.0
"""Seconds of history, as tf2's default."""

_UNIT_TOLERANCE = 0.01
"""tf2 refuses a quaternion whose squared length is this far from 1."""


class Rejection(NamedTuple):
    """Why a transform was not stored: tf2's code, and a text."""

    code: str
    text: str


class FrameInfo(NamedTuple):
    """One child frame; times in ns, rate in Hz."""

    parent: str
    authority: str
    static: bool
    rate: float
    oldest: int
    newest: int
    samples: int


class _Path(NamedTuple):
    """Edges from two frames up to their common ancestor."""

    version: int
    source: tuple[Edge, ...]
    target: tuple[Edge, ...]


class Buffer:
    """Transforms over time. Thread-safe; `changed` is notified whenever something was stored."""

    def __init__(self, cache_time: float = DEFAULT_CACHE) -> None:
        self._cache = round(cache_time * 1e9)
        self._edges: dict[str, Edge] = {}
        self._frames: set[str] = set()
        """Every frame that was ever a child or a parent."""
        self._irregular: set[str] = set()
        """Children whose parent changes within their history."""
        self._version = 0
        self._paths: dict[tuple[str, str], _Path] = {}
        self.changed = threading.Condition(threading.RLock())
        self.duplicates = 0

    def set_transform(self, transform: TransformStamped, authority: str) -> Rejection | None:
        """Store one sample of a moving edge; None, or why not."""
        return self._set(transform, authority, static=False)

    def set_transform_static(self, transform: TransformStamped, authority: str) -> Rejection | None:
        """Store an edge that holds at all times; None, or why not."""
        return self._set(transform, authority, static=True)

    def _set(self, transform: TransformStamped, authority: str, static: bool) -> Rejection | None:
        parent = strip_slash(transform.header.frame_id)
        child = strip_slash(transform.child_frame_id)
        floats = _floats_of(transform)
        refused = _check_names(parent, child, authority) or _check_numbers(floats, child, authority)
        if refused:
            return refused
        sample = Sample(_normalised(floats), parent, authority)
        stamp = 0 if static else ns_from_time(transform.header.stamp)
        with self.changed:
            refused = self._check_place(child, parent, stamp, sample, static)
            if refused is None:
                self._store(child, stamp, sample, static)
                self.changed.notify_all()
            elif refused.code == "DUPLICATE":
                self.duplicates += 1
                return None
            return refused

    def _check_place(self, child: str, parent: str, stamp: int, sample: Sample, static: bool) -> Rejection | None:
        edge = self._edges.get(child)
        if edge is not None and edge.samples:
            if edge.static and not static:
                return Rejection(
                    "TF_STATIC_FRAME", f"{child} is static by {edge.authority}: {sample.authority}'s sample is refused"
                )
            if not static and not edge.static:
                if edge.stamps[-1] > stamp + self._cache:
                    return Rejection(
                        "TF_OLD_DATA",
                        f"{child} from {sample.authority} is older than the cache of {self._cache / 1e9} s",
                    )
                at = edge.find(stamp)
                if at >= 0:
                    if edge.samples[at].floats == sample.floats and edge.samples[at].parent == parent:
                        return Rejection("DUPLICATE", "")
                    return Rejection("TF_REPEATED_DATA", f"{child} has a sample of {stamp / 1e9:.9f} s already")
            if edge.parent == parent:
                return None
        return self._check_loop(child, parent, sample.authority)

    def _check_loop(self, child: str, parent: str, authority: str) -> Rejection | None:
        frame: str = parent
        while frame:
            edge = self._edges.get(frame)
            if frame == child or edge is None:
                break
            frame = edge.parent
        if frame != child:
            return None
        other = self._edges[parent].authority if parent in self._edges else authority
        return Rejection("TF_LOOP", f"{parent} -> {child} by {authority} closes a loop with {other}'s transforms")

    def _store(self, child: str, stamp: int, sample: Sample, static: bool) -> None:
        edge = self._edges.get(child)
        if edge is None or edge.static != static:
            edge = self._edges[child] = Edge(static)
            self._version += 1
        before = edge.parent
        if static:
            edge.replace(sample)
        else:
            edge.insert(stamp, sample)
            edge.prune(edge.stamps[-1] - self._cache)
        edge.authority = sample.authority
        if edge.parent != before:
            self._version += 1
        self._frames.update((child, sample.parent))
        if edge.parents:
            self._irregular.add(child)
        else:
            self._irregular.discard(child)

    def set_all_static(self, transforms: Iterable[TransformStamped], authority: str) -> list[Rejection]:
        """Take the full set of an authority's static transforms: what it no longer has is forgotten."""
        with self.changed:
            kept = {strip_slash(t.child_frame_id): t for t in transforms}
            for child, edge in list(self._edges.items()):
                # An edge that hangs elsewhere from now on must not make a loop of the new set.
                if edge.static and edge.authority == authority and _parent_in(kept.get(child)) != edge.parent:
                    self.forget(child)
            refused = [self.set_transform_static(t, authority) for t in kept.values()]
        return [r for r in refused if r]

    def forget(self, child: str) -> None:
        """Forget an edge and its history."""
        with self.changed:
            if self._edges.pop(child, None) is not None:
                self._irregular.discard(child)
                self._version += 1

    def clear(self) -> None:
        """Forget all moving data; static transforms and the names of frames stay (as in tf2)."""
        with self.changed:
            for edge in self._edges.values():
                if not edge.static:
                    edge.stamps, edge.samples, edge.parents = [], [], 0
            self._irregular.clear()
            self._version += 1

    def lookup_transform(self, target_frame: str, source_frame: str, time: int) -> TransformStamped:
        """The pose of `source_frame` in `target_frame` at `time`. Raises tf2's exceptions."""
        with self.changed:
            floats, stamp = self._lookup(target_frame, source_frame, time)
        return _message_of(floats, stamp, target_frame, source_frame)

    def lookup_pose2(self, target_frame: str, source_frame: str, time: int) -> tuple[Pose2, int]:
        """The same in the plane, with its stamp: (x, y, yaw) of `source_frame` in `target_frame`."""
        with self.changed:
            (x, y, _, i, j, k, w), stamp = self._lookup(target_frame, source_frame, time)
        return Pose2(x, y, yaw_from_quaternion(i, j, k, w)), stamp

    def lookup_transform_full(
        self, target_frame: str, target_time: int, source_frame: str, source_time: int, fixed_frame: str
    ) -> TransformStamped:
        """target(target_time)_from_source(source_time), both tied together by `fixed_frame`, which does not move."""
        with self.changed:
            self._check_frames(target_frame=target_frame, source_frame=source_frame, fixed_frame=fixed_frame)
            fixed_from_source, _ = self._lookup(fixed_frame, source_frame, source_time)
            target_from_fixed, stamp = self._lookup(target_frame, fixed_frame, target_time)
        return _message_of(compose(target_from_fixed, fixed_from_source), stamp, target_frame, source_frame)

    def can_transform(self, target_frame: str, source_frame: str, time: int) -> tuple[bool, str]:
        """Whether `lookup_transform` would answer, and if not why."""
        try:
            with self.changed:
                self._lookup(target_frame, source_frame, time)
        except TransformException as error:
            return False, str(error)
        return True, ""

    def can_transform_full(
        self, target_frame: str, target_time: int, source_frame: str, source_time: int, fixed_frame: str
    ) -> tuple[bool, str]:
        """Whether `lookup_transform_full` would answer, and if not why."""
        try:
            self.lookup_transform_full(target_frame, target_time, source_frame, source_time, fixed_frame)
        except TransformException as error:
            return False, str(error)
        return True, ""

    def wait_for_transform(self, target_frame: str, source_frame: str, time: int, timeout: float) -> TransformStamped:
        """The look-up's answer as soon as it has one; after `timeout` host seconds, its exception."""
        with self.changed:
            wait_until(self.changed, lambda: self.can_transform(target_frame, source_frame, time)[0], timeout)
            return self.lookup_transform(target_frame, source_frame, time)

    def latest_common_time(self, target_frame: str, source_frame: str) -> int | None:
        """Stamp (ns) up to which the two frames are connected; 0 if all is static, None if they are not."""
        with self.changed:
            try:
                self._check_frames(target_frame=target_frame, source_frame=source_frame)
                if target_frame == source_frame:
                    return self._newest(target_frame)
                path = self._path(target_frame, source_frame)
            except TransformException:
                return None
            return _latest(path.source + path.target)

    def frames(self) -> dict[str, FrameInfo]:
        """Every child frame, sorted by name."""
        with self.changed:
            return {child: _info(edge) for child, edge in sorted(self._edges.items()) if edge.samples}

    def _check_frames(self, **arguments: str) -> None:
        for argument, name in arguments.items():
            what = f"passed to lookupTransform argument {argument}"
            if not name:
                raise InvalidArgumentException(f"Invalid argument {what} in tf2 frame_ids cannot be empty")
            if name.startswith("/"):
                raise InvalidArgumentException(
                    f"Invalid argument \"{name}\" {what} in tf2 frame_ids cannot start with a '/' like: "
                )
        for argument, name in arguments.items():
            if name not in self._frames:
                raise LookupException(f'"{name}" passed to lookupTransform argument {argument} does not exist. ')

    def _lookup(self, target: str, source: str, time: int) -> tuple[Floats, int]:
        if target == source:
            return IDENTITY, time or self._newest(target)
        self._check_frames(target_frame=target, source_frame=source)
        if time == 0:
            path = self._path(target, source)
            time = _latest(path.source + path.target)
            if self._irregular:
                # At that time other parents may have held than now.
                path = self._walk(target, source, time)
        else:
            path = self._path_at(target, source, time)
        try:
            return _evaluate(path, time, (source, target)), time
        except ExtrapolationException:
            # Of several edges without data, tf2 names the one that a walk through the tree comes upon.
            self._walk(target, source, time)
            raise

    def _newest(self, frame: str) -> int:
        edge = self._edges.get(frame)
        return edge.stamps[-1] if edge is not None and edge.stamps and not edge.static else 0

    def _path(self, target: str, source: str) -> _Path:
        """The path by the newest parents, cached until the tree changes its shape."""
        path = self._paths.get((target, source))
        if path is None or path.version != self._version:
            path = self._walk(target, source, None)
            self._paths[target, source] = path
        return path

    def _path_at(self, target: str, source: str, time: int) -> _Path:
        """The path at a time: the cached one unless a parent changed within the history of the tree."""
        if self._irregular:
            return self._walk(target, source, time)
        try:
            return self._path(target, source)
        except ConnectivityException:
            return self._walk(target, source, time)

    def _walk(self, target: str, source: str, time: int | None) -> _Path:
        up = self._ancestors(source, time)
        down: list[Edge] = []
        frame = target
        depth = {name: i for i, (name, _) in enumerate(up)}
        failure: TransformException | None = None
        while frame not in depth:
            if len(down) > len(self._edges):
                raise LookupException("The tf tree is invalid because it contains a loop.")
            edge = self._edges.get(frame)
            parent, problem = _parent(edge, time, (source, target))
            failure = problem or failure
            if edge is None or not parent:
                raise failure or self._first_failure(source, time, (source, target)) or _unconnected(target, source)
            down.append(edge)
            frame = parent
        top = depth[frame]
        return _Path(self._version, tuple(e for _, e in up[:top] if e is not None), tuple(down))

    def _ancestors(self, frame: str, time: int | None) -> list[tuple[str, Edge | None]]:
        """`frame` and everything above it, each with the edge that leads further up (None at the top)."""
        found: list[tuple[str, Edge | None]] = []
        while True:
            if len(found) > len(self._edges) + 1:
                raise LookupException("The tf tree is invalid because it contains a loop.")
            edge = self._edges.get(frame)
            parent, _ = _parent(edge, time, ("", ""))
            found.append((frame, edge if parent else None))
            if not parent:
                return found
            frame = parent

    def _first_failure(self, frame: str, time: int | None, what: tuple[str, str]) -> TransformException | None:
        """The extrapolation that ended the walk up from `frame`, if one did."""
        while True:
            parent, problem = _parent(self._edges.get(frame), time, what)
            if not parent:
                return problem
            frame = parent


def _parent(edge: Edge | None, time: int | None, what: tuple[str, str]) -> tuple[str, TransformException | None]:
    """The edge's parent at `time` (None = newest), or empty with the reason."""
    if edge is None or (time is None and not edge.samples):
        return "", None
    if time is None or edge.static:
        return edge.parent, None
    try:
        return edge.samples[_index(edge, time, what)].parent, None
    except TransformException as error:
        return "", error


def _unconnected(target: str, source: str) -> ConnectivityException:
    return ConnectivityException(
        f"Could not find a connection between '{target}' and '{source}' because they are not part of the same tree."
        "Tf has two or more unconnected trees."
    )


def _latest(edges: tuple[Edge, ...]) -> int:
    """The newest time that all moving edges have; edges stamped 0 count as static, as in tf2."""
    return min((e.stamps[-1] for e in edges if not e.static and e.stamps and e.stamps[-1]), default=0)


def _index(edge: Edge, time: int, what: tuple[str, str]) -> int:
    """Index of the newest sample that is not newer than `time`. Raises the three kinds of extrapolation."""
    stamps = edge.stamps
    looking = f", when looking up transform from frame [{what[0]}] to frame [{what[1]}]"
    if not stamps:
        raise NoDataForExtrapolationException(f"Lookup would require data, but the buffer was cleared{looking}")
    newest = len(stamps) - 1
    if time == stamps[newest]:
        return newest
    if newest == 0:
        raise NoDataForExtrapolationException(
            f"Lookup would require extrapolation at time {_seconds(time)}, but only time {_seconds(stamps[0])} "
            f"is in the buffer{looking}"
        )
    if time > stamps[newest]:
        raise ForwardExtrapolationException(
            f"Lookup would require extrapolation {_seconds(time - stamps[newest])}s into the future.  "
            f"Requested time {_seconds(time)} but the latest data is at time {_seconds(stamps[newest])}{looking}"
        )
    if time < stamps[0]:
        raise BackwardExtrapolationException(
            f"Lookup would require extrapolation {_seconds(stamps[0] - time)}s into the past.  "
            f"Requested time {_seconds(time)} but the earliest data is at time {_seconds(stamps[0])}{looking}"
        )
    return bisect_right(stamps, time) - 1


def _seconds(nanoseconds: int) -> str:
    """To the nanosecond: a double's digits do not reach that far."""
    whole, rest = divmod(nanoseconds, 10**9)
    return f"{whole}.{rest:09d}"


def _evaluate(path: _Path, time: int, what: tuple[str, str]) -> Floats:
    source_side, target_side = IDENTITY, IDENTITY
    for edge in path.source:
        source_side = compose(_at(edge, time, what), source_side)
    for edge in path.target:
        target_side = compose(_at(edge, time, what), target_side)
    return compose(invert(target_side), source_side) if path.target else source_side


def _at(edge: Edge, time: int, what: tuple[str, str]) -> Floats:
    if edge.static:
        return edge.samples[0].floats
    at = _index(edge, time, what)
    older = edge.samples[at]
    stamp = edge.stamps[at]
    if stamp == time:
        return older.floats
    newer = edge.samples[at + 1]
    if newer.parent != older.parent:
        # Nothing lies between two parents: the older sample holds until the change.
        return older.floats
    return interpolate(older.floats, newer.floats, (time - stamp) / (edge.stamps[at + 1] - stamp))


def _parent_in(transform: TransformStamped | None) -> str | None:
    return None if transform is None else strip_slash(transform.header.frame_id)


def _info(edge: Edge) -> FrameInfo:
    oldest, newest, count = edge.stamps[0], edge.stamps[-1], len(edge.stamps)
    rate = 0.0 if edge.static or newest == oldest else (count - 1) * 1e9 / (newest - oldest)
    return FrameInfo(edge.parent, edge.authority, edge.static, rate, oldest, newest, count)


def _check_names(parent: str, child: str, authority: str) -> Rejection | None:
    if not child:
        return Rejection("TF_NO_CHILD_FRAME_ID", f"a transform from {authority} has no child_frame_id")
    if not parent:
        return Rejection("TF_NO_FRAME_ID", f"{child} from {authority} has no frame_id")
    if parent == child:
        return Rejection("TF_SELF_TRANSFORM", f"{child} from {authority} is its own parent")
    return None


def _check_numbers(floats: Floats, child: str, authority: str) -> Rejection | None:
    if not all(map(math.isfinite, floats)):
        return Rejection("TF_NAN_INPUT", f"{child} from {authority} holds a number that is not finite")
    _, _, _, i, j, k, w = floats
    if abs(i * i + j * j + k * k + w * w - 1.0) >= _UNIT_TOLERANCE:
        return Rejection(
            "TF_DENORMALIZED_QUATERNION", f"{child} from {authority} has a rotation that is no unit quaternion"
        )
    return None


def _normalised(floats: Floats) -> Floats:
    x, y, z, i, j, k, w = floats
    square = i * i + j * j + k * k + w * w
    if abs(square - 1.0) < 1e-15:
        return floats
    scale = 1.0 / math.sqrt(square)
    return (x, y, z, i * scale, j * scale, k * scale, w * scale)


def _floats_of(message: TransformStamped) -> Floats:
    t, r = message.transform.translation, message.transform.rotation
    return (t.x, t.y, t.z, r.x, r.y, r.z, r.w)


def _message_of(floats: Floats, stamp: int, target: str, source: str) -> TransformStamped:
    x, y, z, i, j, k, w = floats
    return TransformStamped(
        Header(time_from_ns(stamp), target), source, Transform(Vector3(x, y, z), Quaternion(i, j, k, w))
    )
