"""The transform buffer: tf2's contract, pure Python, no bus.

Times are integer nanoseconds; 0 means the latest common time. `lookup_transform(target, source, t)` takes data from
`source` into `target`: it is the pose of `source` in `target`. Where this differs from tf2 on purpose, docs/transforms
has the table: quaternions are normalised, inf, NaN and loops are refused when they come, a refused sample leaves no
trace, exact duplicates are counted silently, dynamic data on a static frame is refused, no error text is empty.
"""

import logging
import math
import threading
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from zteam.clock import wait_until
from zteam.geometry import Pose2, yaw_from_quaternion
from zteam.messages import (
    Header,
    LaserScan,
    PointStamped,
    PoseStamped,
    Quaternion,
    Time,
    Transform,
    TransformStamped,
    Twist,
    Vector3,
    Vector3Stamped,
    ns_from_time,
    time_from_ns,
)
from zteam.names import strip_slash
from zteam.tf.applying import (
    apply_to_point,
    apply_to_points,
    apply_to_pose,
    apply_to_poses,
    apply_to_vector,
    scan_points,
    twist_between,
)
from zteam.tf.edges import Edge, Value
from zteam.tf.errors import (
    ConnectivityException,
    ExtrapolationException,
    InvalidArgumentException,
    LookupException,
    TransformException,
)
from zteam.tf.paths import Path, evaluate, evaluate_quickly, latest, walk
from zteam.tf.rigid import IDENTITY, Floats, compose

log = logging.getLogger("zteam.tf")

DEFAULT_CACHE = 10.0
"""Seconds of history, as tf2's default."""

_ROUNDING = 1e-12
"""A squared length this near to 1 is 1 but for rounding."""
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


class Buffer:
    """Transforms over time. Thread-safe: every call sees one state of the tree."""

    def __init__(self, cache_time: float = DEFAULT_CACHE) -> None:
        self._cache = round(cache_time * 1e9)
        self._edges: dict[str, Edge] = {}
        self._frames: set[str] = set()
        """Every frame that was ever a child or a parent."""
        self._paths: dict[tuple[str, str], Path] = {}
        """What the tree's present shape makes of pairs that were asked for."""
        self.lock = threading.RLock()
        """Held by whoever wants several calls to see one state."""
        # Calls of these take half the time of a with statement.
        self._acquire, self._release = self.lock.acquire, self.lock.release
        self._changed = threading.Condition(self.lock)
        self._waiting = 0
        self._now = 0
        self.duplicates = 0

    def set_transform(self, transform: TransformStamped, authority: str) -> Rejection | None:
        """Store one sample of a moving edge; None, or why not."""
        self._acquire()
        try:
            # The usual case first, and in one piece: a planar sample, newer than all others, of an edge as it is. It
            # comes a thousand times for every other, and calls cost more here than arithmetic.
            edge, header, pose = self._edges[transform.child_frame_id], transform.header, transform.transform
            rotation = pose.rotation
            if edge.plain_parent == header.frame_id and rotation.x == 0.0 and rotation.y == 0.0:
                stamp, offset, stamps = header.stamp, pose.translation, edge.stamps
                time = stamp.sec * 1_000_000_000 + stamp.nanosec
                x, y, z, k, w = value = offset.x, offset.y, offset.z, rotation.z, rotation.w
                # 0 for a unit quaternion and finite numbers: 0 times inf or NaN is NaN.
                off = k * k + w * w - 1.0 + 0.0 * (x + y + z)
                if time > stamps[-1] and off * off < 1e-24:
                    stamps.append(time)
                    edge.values.append(value)
                    edge.authority = authority
                    if time > edge.expiry:
                        edge.prune(self._cache)
                    if self._waiting:
                        self._changed.notify_all()
                    return None
        except KeyError:
            pass  # a new frame, which is not the usual case
        finally:
            self._release()
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
        value = _value_of(floats)
        stamp = 0 if static else ns_from_time(transform.header.stamp)
        with self.lock:
            refused = self._check_place(child, parent, stamp, value, static, authority)
            if refused is None:
                self._store(child, parent, stamp, value, static, authority)
                if self._waiting:
                    self._changed.notify_all()
            elif refused.code == "DUPLICATE":
                self.duplicates += 1
                return None
            return refused

    def _check_place(
        self, child: str, parent: str, stamp: int, value: Value, static: bool, authority: str
    ) -> Rejection | None:
        edge = self._edges.get(child)
        if edge is not None and edge.stamps:
            if edge.static and not static:
                return Rejection(
                    "TF_STATIC_FRAME", f"{child} is static by {edge.authority}: {authority}'s sample is refused"
                )
            if not static and not edge.static:
                if edge.stamps[-1] > stamp + self._cache:
                    return Rejection(
                        "TF_OLD_DATA", f"{child} from {authority} is older than the cache of {self._cache / 1e9} s"
                    )
                at = edge.find(stamp)
                if at >= 0:
                    if edge.values[at] == value and edge.parent_at(at) == parent:
                        return Rejection("DUPLICATE", "")
                    return Rejection("TF_REPEATED_DATA", f"{child} has a sample of {stamp / 1e9:.9f} s already")
            if edge.parent == parent:
                return None
        return self._check_loop(child, parent, authority)

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

    def _store(self, child: str, parent: str, stamp: int, value: Value, static: bool, authority: str) -> None:
        edge = self._edges.get(child)
        if edge is None or edge.static != static:
            edge = self._edges[child] = Edge(static)
        before = edge.shape()
        if static:
            edge.replace(value, parent)
        else:
            edge.insert(stamp, value, parent, self._cache)
        edge.authority = authority
        if before != edge.shape():
            self._paths.clear()
        self._frames.update((child, parent))

    def set_all_static(self, transforms: Iterable[TransformStamped], authority: str) -> list[Rejection]:
        """Take the full set of an authority's static transforms: what it no longer has is forgotten."""
        with self.lock:
            kept = {strip_slash(t.child_frame_id): t for t in transforms}
            for child, edge in list(self._edges.items()):
                # An edge that hangs elsewhere from now on must not make a loop of the new set.
                if edge.static and edge.authority == authority and _parent_in(kept.get(child)) != edge.parent:
                    self.forget(child)
            refused = [self.set_transform_static(t, authority) for t in kept.values()]
        return [r for r in refused if r]

    def forget(self, child: str) -> None:
        """Forget an edge and its history."""
        with self.lock:
            if self._edges.pop(child, None) is not None:
                self._paths.clear()

    def clear(self) -> None:
        """Forget all moving data; static transforms and the names of frames stay (as in tf2)."""
        with self.lock:
            for edge in self._edges.values():
                if not edge.static:
                    edge.forget()
            self._paths.clear()

    def lookup_transform(self, target_frame: str, source_frame: str, time: int) -> TransformStamped:
        """The pose of `source_frame` in `target_frame` at `time`. Raises tf2's exceptions."""
        self._acquire()
        try:
            path = self._paths.get((target_frame, source_frame))
            found = evaluate_quickly(path, time) if path is not None and path.is_quick else None
            if found is None:
                floats, stamp = self._lookup(target_frame, source_frame, time)
                return _message_of(floats, stamp, target_frame, source_frame)
        finally:
            self._release()
        # Written out, as `_message_of` says it: this is the hot path.
        (x, y, z, k, w), stamp = found
        return TransformStamped(
            Header(Time(stamp // 1_000_000_000, stamp % 1_000_000_000), target_frame),
            source_frame,
            Transform(Vector3(x, y, z), Quaternion(0.0, 0.0, k, w)),
        )

    def lookup_pose2(self, target_frame: str, source_frame: str, time: int) -> tuple[Pose2, int]:
        """The same in the plane, with its stamp: (x, y, yaw) of `source_frame` in `target_frame`."""
        with self.lock:
            (x, y, _, i, j, k, w), stamp = self._lookup(target_frame, source_frame, time)
        return Pose2(x, y, yaw_from_quaternion(i, j, k, w)), stamp

    def lookup_transform_full(
        self, target_frame: str, target_time: int, source_frame: str, source_time: int, fixed_frame: str
    ) -> TransformStamped:
        """target(target_time)_from_source(source_time), both tied together by `fixed_frame`, which does not move."""
        with self.lock:
            self._check_frames(target_frame=target_frame, source_frame=source_frame, fixed_frame=fixed_frame)
            fixed_from_source, _ = self._lookup(fixed_frame, source_frame, source_time)
            target_from_fixed, stamp = self._lookup(target_frame, fixed_frame, target_time)
        return _message_of(compose(target_from_fixed, fixed_from_source), stamp, target_frame, source_frame)

    def can_transform(self, target_frame: str, source_frame: str, time: int) -> tuple[bool, str]:
        """Whether `lookup_transform` would answer, and if not why."""
        try:
            with self.lock:
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

    def transform_pose(self, pose: PoseStamped, target_frame: str) -> PoseStamped:
        """A stamped pose in another frame, at its own stamp (0 = latest). Raises tf2's exceptions."""
        found = self._found_for(pose.header, target_frame)
        return PoseStamped(Header(found.header.stamp, target_frame), apply_to_pose(found.transform, pose.pose))

    def transform_point(self, point: PointStamped, target_frame: str) -> PointStamped:
        """A stamped point in another frame."""
        found = self._found_for(point.header, target_frame)
        return PointStamped(Header(found.header.stamp, target_frame), apply_to_point(found.transform, point.point))

    def transform_vector(self, vector: Vector3Stamped, target_frame: str) -> Vector3Stamped:
        """A stamped direction in another frame: turned, not moved."""
        found = self._found_for(vector.header, target_frame)
        return Vector3Stamped(Header(found.header.stamp, target_frame), apply_to_vector(found.transform, vector.vector))

    def transform_scan(self, scan: LaserScan, target_frame: str) -> NDArray[np.float64]:
        """Where a scan's beams end, (beams, 3) metres in another frame; beams without a hit are NaN."""
        return apply_to_points(self._found_for(scan.header, target_frame).transform, scan_points(scan))

    def transform_poses(
        self, poses: NDArray[np.float64], target_frame: str, source_frame: str, time: int
    ) -> NDArray[np.float64]:
        """(N, 3) planar poses (x, y, yaw) of `source_frame` in `target_frame`."""
        return apply_to_poses(self.lookup_transform(target_frame, source_frame, time).transform, poses)

    def _found_for(self, header: Header, target_frame: str) -> TransformStamped:
        return self.lookup_transform(target_frame, header.frame_id, ns_from_time(header.stamp))

    def lookup_twist(
        self, tracking_frame: str, observation_frame: str, time: int, averaging_interval: float = 0.1
    ) -> Twist:
        """The mean velocity of one frame seen from another, in the latter's axes, over an interval about `time`.

        The interval (seconds) ends at the latest common time if it would lie beyond it, as in tf. Raises tf2's
        exceptions, and InvalidArgumentException for an interval that is not above 0.
        """
        if not averaging_interval > 0.0:
            raise InvalidArgumentException(f"an averaging interval of {averaging_interval:g} s is not above 0")
        interval = round(averaging_interval * 1e9)
        with self.lock:
            _, newest = self._lookup(observation_frame, tracking_frame, 0)
            end = min(newest, time + interval // 2) if time else newest
            after, _ = self._lookup(observation_frame, tracking_frame, end)
            before, _ = self._lookup(observation_frame, tracking_frame, end - interval)
        return twist_between(before, after, averaging_interval)

    def take_time(self, now: int) -> bool:
        """Hear the clock (ns). Where it jumped back, moving data is forgotten, which is said; True if so."""
        with self.lock:
            jumped, self._now = now < self._now, now
            if jumped:
                log.warning("Detected jump back in time. Clearing TF buffer.")
                self.clear()
        return jumped

    def wait_for_transform(self, target_frame: str, source_frame: str, time: int, timeout: float) -> TransformStamped:
        """The look-up's answer as soon as it has one; after `timeout` host seconds, its exception."""
        with self.lock:
            self._waiting += 1
            try:
                wait_until(self._changed, lambda: self.can_transform(target_frame, source_frame, time)[0], timeout)
            finally:
                self._waiting -= 1
            return self.lookup_transform(target_frame, source_frame, time)

    def latest_common_time(self, target_frame: str, source_frame: str) -> int | None:
        """Stamp (ns) up to which the two frames are connected; 0 if all is static, None if they are not."""
        with self.lock:
            try:
                self._check_frames(target_frame=target_frame, source_frame=source_frame)
                if target_frame == source_frame:
                    return self._newest(target_frame)
                path = self._path(target_frame, source_frame)
            except TransformException:
                return None
            return latest(path.source + path.target)

    def frames(self) -> dict[str, FrameInfo]:
        """Every child frame, sorted by name."""
        with self.lock:
            return {child: _info(edge) for child, edge in sorted(self._edges.items()) if edge.stamps}

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
            time = latest(path.source + path.target)
            if any(edge.parents is not None for edge in path.source + path.target):
                # At that time other parents may have held than now.
                path = walk(self._edges, target, source, time)
        else:
            path = self._path_at(target, source, time)
        try:
            return evaluate(path, time, (source, target)), time
        except ExtrapolationException:
            # Of several edges without data, tf2 names the one that a walk through the tree comes upon.
            walk(self._edges, target, source, time)
            raise

    def _newest(self, frame: str) -> int:
        edge = self._edges.get(frame)
        return edge.stamps[-1] if edge is not None and edge.stamps and not edge.static else 0

    def _path(self, target: str, source: str) -> Path:
        """The path by the newest parents, kept until the tree changes its shape."""
        path = self._paths.get((target, source))
        if path is None:
            path = self._paths[target, source] = walk(self._edges, target, source, None)
        return path

    def _path_at(self, target: str, source: str, time: int) -> Path:
        """The path at a time: the newest one unless a parent changed within its history."""
        try:
            path = self._path(target, source)
        except ConnectivityException:
            return walk(self._edges, target, source, time)
        if any(edge.parents is not None for edge in path.source + path.target):
            return walk(self._edges, target, source, time)
        return path


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


def _value_of(floats: Floats) -> Value:
    """With a rotation of length 1, and planar if it is."""
    x, y, z, i, j, k, w = floats
    square = i * i + j * j + k * k + w * w
    scale = 1.0 if abs(square - 1.0) < _ROUNDING else 1.0 / math.sqrt(square)
    if i == 0.0 and j == 0.0:
        return x, y, z, k * scale, w * scale
    return x, y, z, i * scale, j * scale, k * scale, w * scale


def _floats_of(message: TransformStamped) -> Floats:
    t, r = message.transform.translation, message.transform.rotation
    return (t.x, t.y, t.z, r.x, r.y, r.z, r.w)


def _message_of(floats: Floats, stamp: int, target: str, source: str) -> TransformStamped:
    x, y, z, i, j, k, w = floats
    return TransformStamped(
        Header(time_from_ns(stamp), target), source, Transform(Vector3(x, y, z), Quaternion(i, j, k, w))
    )
