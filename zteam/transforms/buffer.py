"""The transform buffer: it behaves like tf2's, in pure Python, without the bus.

Times are integer nanoseconds; 0 means the latest common time. `lookup_transform(target, source, t)` is the pose of
`source` in `target`. docs/transforms lists the intended differences from tf2. Each public call takes the one lock.
"""

import logging
import threading
from collections.abc import Callable, Iterable

import numpy as np
from numpy.typing import NDArray

from zteam import messages
from zteam.clock import wait_until
from zteam.geometry import Pose2, yaw_from_quaternion
from zteam.messages import Header, LaserScan, PoseStamped, Quaternion, Time, Transform, TransformStamped, Vector3
from zteam.names import strip_slash
from zteam.transforms.errors import InvalidArgumentException, TransformException
from zteam.transforms.rigid import compose, floats_of, rotation_matrix, scan_points, stamped_transform, twist_between
from zteam.transforms.tree import FrameInfo, Rejection, Tree

log = logging.getLogger("zteam.tf")

DEFAULT_CACHE = 10.0
"""Seconds of history, as tf2's default."""

_NS = 1_000_000_000


class Buffer:
    """Transforms over time. Thread-safe; while a thread holds `lock`, the calls of other threads wait."""

    def __init__(self, cache_time: float = DEFAULT_CACHE) -> None:
        self.lock = threading.RLock()
        self._tree = Tree(round(cache_time * 1e9))
        self._changed = threading.Condition(self.lock)
        self._waiting = 0
        self._now = 0

    @property
    def duplicates(self) -> int:
        """How many samples came that their edges had already."""
        return self._tree.duplicates

    def set_transform(self, transform: TransformStamped, authority: str) -> Rejection | None:
        """Store one sample of a moving edge; None, or why it was refused."""
        refused = self.set_transforms((transform,), authority)
        return refused[0] if refused else None

    def set_transforms(self, transforms: Iterable[TransformStamped], authority: str, now: int = 0) -> list[Rejection]:
        """Store a sample of each of these moving edges; why some were refused.

        Where the time `now` (ns) is known, a sample that is further ahead of it than the buffer remembers is refused:
        with it, all later ones would be too old.
        """
        found, add, last = [], self._tree.add, now + self._tree.cache if now else None
        with self.lock:
            for transform in transforms:
                header, pose = transform.header, transform.transform
                p, q, stamp = pose.translation, pose.rotation, header.stamp
                time = stamp.sec * _NS + stamp.nanosec
                if last is not None and time > last:
                    text = f"{transform.child_frame_id} is {(time - now) / 1e9:.1f} s ahead of the time"
                    found.append(Rejection("TF_FUTURE_DATA", text))
                    continue
                floats = p.x, p.y, p.z, q.x, q.y, q.z, q.w
                refused = add(transform.child_frame_id, header.frame_id, time, floats, authority)
                if refused is not None:
                    found.append(refused)
            if self._waiting:
                self._changed.notify_all()
        return found

    def set_transform_static(self, transform: TransformStamped, authority: str) -> Rejection | None:
        """Store an edge that holds at all times; None, or why it was refused."""
        parent, floats = transform.header.frame_id, floats_of(transform.transform)
        with self.lock:
            refused = self._tree.put(transform.child_frame_id, parent, 0, floats, authority, static=True)
            if self._waiting:
                self._changed.notify_all()
        return refused

    def set_all_static(self, transforms: Iterable[TransformStamped], authority: str) -> list[Rejection]:
        """Store the full set of an authority's static transforms; edges that the set no longer has are forgotten."""
        with self.lock:
            kept = {strip_slash(t.child_frame_id): t for t in transforms}
            parents = {child: strip_slash(t.header.frame_id) for child, t in kept.items()}
            for child, edge in list(self._tree.edges.items()):
                # An old edge whose parent changes could make the new set look like a loop.
                if edge.static and edge.authority == authority and parents.get(child) != edge.parent:
                    self.forget(child)
            refused = [self.set_transform_static(t, authority) for t in kept.values()]
        return [r for r in refused if r]

    def forget(self, child: str) -> None:
        """Forget an edge and its history."""
        with self.lock:
            self._tree.forget(child)

    def clear(self) -> None:
        """Forget all moving data; static transforms and the names of the frames stay, as in tf2."""
        with self.lock:
            self._tree.clear()

    def take_time(self, now: int) -> bool:
        """Take the current time (ns): True if it jumped back, which clears the buffer and is logged."""
        with self.lock:
            before, self._now = self._now, now
            if now >= before:
                return False
            self.clear()
        log.warning("Detected jump back in time of %.3f s. Clearing TF buffer.", (before - now) / 1e9)
        return True

    def lookup_transform(self, target_frame: str, source_frame: str, time: int = 0) -> TransformStamped:
        """The pose of `source_frame` in `target_frame` at `time`. Raises tf2's exceptions."""
        with self.lock:
            stamp, x, y, z, i, j, k, w = self._tree.solve(target_frame, source_frame, time)
        return TransformStamped(
            Header(Time(stamp // _NS, stamp % _NS), target_frame),
            source_frame,
            Transform(Vector3(x, y, z), Quaternion(i, j, k, w)),
        )

    def lookup_pose2(self, target_frame: str, source_frame: str, time: int = 0) -> tuple[Pose2, int]:
        """The planar pose of `source_frame` in `target_frame`, and its stamp (ns). Raises tf2's exceptions."""
        with self.lock:
            stamp, x, y, _, i, j, k, w = self._tree.solve(target_frame, source_frame, time)
        return Pose2(x, y, yaw_from_quaternion(i, j, k, w)), stamp

    def lookup_transform_full(
        self, target_frame: str, target_time: int, source_frame: str, source_time: int, fixed_frame: str
    ) -> TransformStamped:
        """The pose of the source at `source_time` in the target at `target_time`.

        Both are looked up relative to `fixed_frame`, which does not move between the two times.
        """
        with self.lock:
            self._tree.check_frames(target_frame=target_frame, source_frame=source_frame, fixed_frame=fixed_frame)
            source = self._tree.solve(fixed_frame, source_frame, source_time)
            target = self._tree.solve(target_frame, fixed_frame, target_time)
        return stamped_transform(
            messages.time_from_ns(target[0]), target_frame, source_frame, compose(target[1:], source[1:])
        )

    def can_transform(self, target_frame: str, source_frame: str, time: int = 0) -> tuple[bool, str]:
        """Whether `lookup_transform` would answer; if not, also its error text."""
        return _answers(self.lookup_transform, target_frame, source_frame, time)

    def can_transform_full(
        self, target_frame: str, target_time: int, source_frame: str, source_time: int, fixed_frame: str
    ) -> tuple[bool, str]:
        """Whether `lookup_transform_full` would answer; if not, also its error text."""
        look_up = self.lookup_transform_full
        return _answers(look_up, target_frame, target_time, source_frame, source_time, fixed_frame)

    def transform_pose(self, pose: PoseStamped, target_frame: str) -> PoseStamped:
        """A stamped pose in another frame, at its own stamp (0 = latest). Raises tf2's exceptions."""
        found = self._found_for(pose.header, target_frame)
        p, o = pose.pose.position, pose.pose.orientation
        x, y, z, i, j, k, w = compose(floats_of(found.transform), (p.x, p.y, p.z, o.x, o.y, o.z, o.w))
        moved = messages.Pose(messages.Point(x, y, z), Quaternion(i, j, k, w))
        return PoseStamped(Header(found.header.stamp, target_frame), moved)

    def transform_point(self, point: messages.PointStamped, target_frame: str) -> messages.PointStamped:
        """A stamped point in another frame."""
        moved = self.transform_pose(PoseStamped(point.header, messages.Pose(point.point)), target_frame)
        return messages.PointStamped(moved.header, moved.pose.position)

    def transform_vector(self, vector: messages.Vector3Stamped, target_frame: str) -> messages.Vector3Stamped:
        """A stamped direction in another frame: it is rotated, not translated."""
        found, v = self._found_for(vector.header, target_frame), vector.vector
        turn = (0.0, 0.0, 0.0, *floats_of(found.transform)[3:])
        x, y, z, *_ = compose(turn, (v.x, v.y, v.z, 0.0, 0.0, 0.0, 1.0))
        return messages.Vector3Stamped(Header(found.header.stamp, target_frame), Vector3(x, y, z))

    def transform_scan(self, scan: LaserScan, target_frame: str) -> NDArray[np.float64]:
        """The end points of a scan's beams in another frame, (beams, 3) metres; NaN for a beam without a hit."""
        floats = floats_of(self._found_for(scan.header, target_frame).transform)
        return np.asarray(scan_points(scan) @ rotation_matrix(floats).T + floats[:3])

    def transform_poses(
        self, poses: NDArray[np.float64], target_frame: str, source_frame: str, time: int
    ) -> NDArray[np.float64]:
        """(N, 3) planar poses (x, y, yaw) of `source_frame` in `target_frame`; yaws are in [-pi, pi].

        If the transform tilts, the heading of each pose is projected onto the plane.
        """
        floats = floats_of(self.lookup_transform(target_frame, source_frame, time).transform)
        plane, given = rotation_matrix(floats)[:2, :2].T, np.asarray(poses, np.float64)
        ahead = np.stack((np.cos(given[:, 2]), np.sin(given[:, 2])), axis=1) @ plane
        return np.column_stack((given[:, :2] @ plane + floats[:2], np.arctan2(ahead[:, 1], ahead[:, 0])))

    def _found_for(self, header: Header, target_frame: str) -> TransformStamped:
        return self.lookup_transform(target_frame, header.frame_id, messages.ns_from_time(header.stamp))

    def lookup_twist(
        self, tracking_frame: str, observation_frame: str, time: int, averaging_interval: float = 0.1
    ) -> messages.Twist:
        """The mean velocity of `tracking_frame` in the axes of `observation_frame`, over an interval centred on `time`.

        An interval (seconds) that would end after the latest common time is moved back to end there, as in tf. Raises
        tf2's exceptions, and InvalidArgumentException for an interval that is not above 0.
        """
        if not averaging_interval > 0.0:
            raise InvalidArgumentException(f"an averaging interval of {averaging_interval:g} s is not above 0")
        interval = round(averaging_interval * 1e9)
        with self.lock:
            newest = self._tree.solve(observation_frame, tracking_frame, 0)[0]
            end = min(newest, time + interval // 2) if time else newest
            after = self._tree.solve(observation_frame, tracking_frame, end)
            before = self._tree.solve(observation_frame, tracking_frame, end - interval)
        return twist_between(before[1:], after[1:], averaging_interval)

    def wait_for_transform(self, target_frame: str, source_frame: str, time: int, timeout: float) -> TransformStamped:
        """Wait until the look-up answers and return its answer; after `timeout` host seconds, raise its exception."""
        with self.lock:
            self._waiting += 1
            try:
                wait_until(self._changed, lambda: self.can_transform(target_frame, source_frame, time)[0], timeout)
            finally:
                self._waiting -= 1
            return self.lookup_transform(target_frame, source_frame, time)

    def latest_common_time(self, target_frame: str, source_frame: str) -> int | None:
        """The newest stamp (ns) that all moving edges between two frames have; 0 if none moves, None if unconnected."""
        with self.lock:
            try:
                return self._tree.latest(target_frame, source_frame)
            except TransformException:
                return None

    def frame(self, child: str) -> FrameInfo | None:
        """The figures of one child frame; None without data."""
        with self.lock:
            edge = self._tree.edges.get(child)
            return edge.info() if edge is not None and edge.parent else None

    def chain(self, frame: str) -> list[str]:
        """A frame and its ancestors, the nearest first, by the newest parents; the frame alone if nothing is known."""
        with self.lock:
            return self._tree.chain(frame)

    def frames(self) -> dict[str, FrameInfo]:
        """The figures of every child frame, sorted by name."""
        with self.lock:
            return {child: edge.info() for child, edge in sorted(self._tree.edges.items()) if edge.parent}


def _answers(look_up: Callable[..., object], *arguments: str | int) -> tuple[bool, str]:
    """Whether a look-up answers; if not, also its error text."""
    try:
        look_up(*arguments)
    except TransformException as error:
        return False, str(error)
    return True, ""
