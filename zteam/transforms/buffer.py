"""The transform buffer: it behaves like tf2's, without the bus.

Times are integer nanoseconds; 0 means the latest common time. `lookup_transform(target, source, t)` is the pose of
`source` in `target`. docs/transforms lists the intended differences from tf2. Each public call takes the one lock.
"""

import logging
import threading
from collections.abc import Callable, Container, Iterable, Iterator
from contextlib import suppress
from typing import Any

import numpy as np
from numpy.typing import NDArray

from zteam import messages
from zteam.clock import NS_PER_S, WatchedCondition
from zteam.geometry import Pose2
from zteam.kernels.transforms import (
    Answer,
    Edge,
    Edges,
    Floats,
    FramePath,
    Names,
    Paths,
    compose,
    gather_poses,
    take_sample,
)
from zteam.messages import Header, LaserScan, PoseStamped, Quaternion, TransformStamped, Vector3
from zteam.messages.geometry_msgs import TransformRows
from zteam.names import strip_slash
from zteam.transforms import errors, rigid, tree
from zteam.transforms.rigid import floats_of, stamped_transform
from zteam.transforms.tree import FrameInfo, Rejection

log = logging.getLogger("zteam.tf")

_FOREVER = 2**63 - 1
DEFAULT_CACHE = 10.0
"""Seconds of history, as tf2's default."""


class Buffer:
    """Transforms over time. Thread-safe; while a thread holds `lock`, the calls of other threads wait."""

    def __init__(self, cache_time: float = DEFAULT_CACHE) -> None:
        self.lock = threading.RLock()
        self._cache = round(cache_time * 1e9)
        """Nanoseconds for which moving frames are remembered."""
        self.duplicates = 0
        """How many samples came that their edges had already."""
        self._names = Names()
        self._edges: dict[str, Edge] = {}
        """By child frame."""
        # All three are cleared if a frame, a parent or a static transform changes.
        self._paths: dict[tuple[str, str], FramePath] = {}
        """By target and source."""
        self._groups: dict[tuple[str, tuple[str, ...]], Paths] = {}
        """Of many sources."""
        self._moving: Edges | None = None
        """Those that bundles bring."""
        self.version = 0
        """How often a frame, a parent or a static transform has changed: what leads over static transforms alone is the
        same meanwhile."""
        self._frames: set[str] = set()
        """Every frame that was ever a child or a parent."""
        self._changed = WatchedCondition(self.lock)
        self._now = 0

    def set_transform(self, transform: TransformStamped, authority: str) -> Rejection | None:
        """Store one sample of a moving edge; None, or why it was refused."""
        refused = self.set_transforms((transform,), authority)
        return refused[0] if refused else None

    def set_transforms(self, transforms: Iterable[TransformStamped], authority: str, now: int = 0) -> list[Rejection]:
        """Store a sample of each of these moving edges; why some were refused.

        Where the time `now` (ns) is known, a sample that is further ahead of it than the buffer remembers is refused:
        with it, all later ones would be too old.
        """
        found: list[Rejection] = []
        latest, name = now + self._cache if now else _FOREVER, self._names[authority]
        with self.lock:
            if type(transforms) is TransformRows:
                transforms = self._take(transforms, name, latest)
            edges = self._edges.get
            for transform in transforms:
                header, pose, child = transform.header, transform.transform, transform.child_frame_id
                p, q, stamp, parent, edge = pose.translation, pose.rotation, header.stamp, header.frame_id, edges(child)
                time, floats = stamp.sec * NS_PER_S + stamp.nanosec, (p.x, p.y, p.z, q.x, q.y, q.z, q.w)
                if time > latest:
                    text = f"{child} is {(time - now) / 1e9:.1f} s ahead of the time"
                    found.append(Rejection("TF_FUTURE_DATA", text))
                    continue
                taken = -1
                if edge is not None and edge.parent == parent:
                    taken = take_sample(edge.edge, time, floats, name)
                if taken == 0:
                    self.duplicates += 1
                elif taken < 0 and (refused := self._put(child, parent, time, floats, authority)) is not None:
                    found.append(refused)
            if self._changed.awaited:
                self._changed.look()
        return found

    def set_transform_static(self, transform: TransformStamped, authority: str) -> Rejection | None:
        """Store an edge that holds at all times; None, or why it was refused."""
        parent, floats = transform.header.frame_id, floats_of(transform.transform)
        with self.lock:
            refused = self._put(transform.child_frame_id, parent, 0, floats, authority, static=True)
            self._changed.look()
        return refused

    def set_all_static(self, transforms: Iterable[TransformStamped], authority: str) -> list[Rejection]:
        """Store the full set of an authority's static transforms; edges that the set no longer has are forgotten."""
        with self.lock:
            kept = {strip_slash(t.child_frame_id): t for t in transforms}
            parents = {child: strip_slash(t.header.frame_id) for child, t in kept.items()}
            for child, edge in list(self._edges.items()):
                # An old edge whose parent changes could make the new set look like a loop.
                if edge.static and edge.authority == authority and parents.get(child) != edge.parent:
                    self.forget(child)
            refused = [self.set_transform_static(t, authority) for t in kept.values()]
        return [r for r in refused if r]

    def forget(self, child: str) -> None:
        """Forget an edge and its history."""
        with self.lock:
            if self._edges.pop(child, None) is not None:
                self._forget_paths()

    def clear(self) -> None:
        """Forget all moving data; static transforms and the names of the frames stay, as in tf2."""
        with self.lock:
            for child, edge in self._edges.items():
                if not edge.static:
                    self._edges[child] = Edge(self._names, child, self._cache)
            self._forget_paths()

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
            stamp, answer = self._solve(target_frame, source_frame, time)
        return stamped_transform(messages.time_from_ns(stamp), target_frame, source_frame, answer[:7])

    def lookup_pose2(self, target_frame: str, source_frame: str, time: int = 0) -> tuple[Pose2, int]:
        """The planar pose of `source_frame` in `target_frame`, and its stamp (ns). Raises tf2's exceptions."""
        with self.lock:
            stamp, (x, y, *_, yaw) = self._solve(target_frame, source_frame, time)
        return Pose2(x, y, yaw), stamp

    def find_poses2(self, target_frame: str, source_frames: tuple[str, ...]) -> tuple[Any, Any]:
        """The newest planar poses of many sources: (sources, 4) doubles for C, x, y (m), yaw (rad) and stamp (ns); and
        the stamps. What `lookup_pose2` would raise for is NaN, its stamp NOT_KNOWN."""
        with self.lock:
            group = self._groups.get((target_frame, source_frames))
            if group is not None:
                poses, stamps, failed = group.solve()
                if not failed:
                    return poses, stamps
            answers = [self._find(target_frame, source_frame) for source_frame in source_frames]
            paths = [self._paths.get((target_frame, source_frame)) for source_frame in source_frames]
            if len(known := [path for path in paths if path is not None]) == len(paths):
                self._groups[target_frame, source_frames] = Paths(known)
        return gather_poses(answers)

    def _find(self, target_frame: str, source_frame: str) -> tuple[Pose2, int] | None:
        with suppress(errors.TransformException):
            return self.lookup_pose2(target_frame, source_frame)
        return None

    def lookup_transform_full(
        self, target_frame: str, target_time: int, source_frame: str, source_time: int, fixed_frame: str
    ) -> TransformStamped:
        """The pose of the source at `source_time` in the target at `target_time`.

        Both are looked up relative to `fixed_frame`, which does not move between the two times.
        """
        with self.lock:
            self._check_frames(target_frame=target_frame, source_frame=source_frame, fixed_frame=fixed_frame)
            source = self._solve(fixed_frame, source_frame, source_time)
            target = self._solve(target_frame, fixed_frame, target_time)
        return stamped_transform(
            messages.time_from_ns(target[0]), target_frame, source_frame, compose(target[1][:7], source[1][:7])
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
        return np.asarray(rigid.scan_points(scan) @ rigid.rotation_matrix(floats).T + floats[:3])

    def transform_poses(
        self, poses: NDArray[np.float64], target_frame: str, source_frame: str, time: int
    ) -> NDArray[np.float64]:
        """(N, 3) planar poses (x, y, yaw) of `source_frame` in `target_frame`; yaws are in [-pi, pi].

        If the transform tilts, the heading of each pose is projected onto the plane.
        """
        floats = floats_of(self.lookup_transform(target_frame, source_frame, time).transform)
        plane, given = rigid.rotation_matrix(floats)[:2, :2].T, np.asarray(poses, np.float64)
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
            raise errors.InvalidArgumentException(f"an averaging interval of {averaging_interval:g} s is not above 0")
        interval = round(averaging_interval * 1e9)
        with self.lock:
            newest = self._solve(observation_frame, tracking_frame, 0)[0]
            end = min(newest, time + interval // 2) if time else newest
            after = self._solve(observation_frame, tracking_frame, end)
            before = self._solve(observation_frame, tracking_frame, end - interval)
        return rigid.twist_between(before[1][:7], after[1][:7], averaging_interval)

    def wait_for_transform(self, target_frame: str, source_frame: str, time: int, timeout: float) -> TransformStamped:
        """Wait until the look-up answers and return its answer; after `timeout` host seconds, raise its exception."""
        with self.lock:
            self._changed.wait_until(lambda: self.can_transform(target_frame, source_frame, time)[0], timeout)
            return self.lookup_transform(target_frame, source_frame, time)

    def latest_common_time(self, target_frame: str, source_frame: str) -> int | None:
        """The newest stamp (ns) that all moving edges between two frames have; 0 if none moves, None if unconnected."""
        with self.lock, suppress(errors.TransformException):
            return self._latest(target_frame, source_frame)
        return None

    def frame(self, child: str) -> FrameInfo | None:
        """The figures of one child frame; None without data."""
        with self.lock:
            edge = self._edges.get(child)
            return tree.info_of(edge) if edge is not None and edge.parent else None

    def chain(self, frame: str) -> list[str]:
        """A frame and its ancestors, the nearest first, by the newest parents; the frame alone if nothing is known."""
        found = [frame]
        with self.lock:
            # This ends: a sample that would close a loop with the newest parents is refused.
            while (edge := self._edges.get(found[-1])) is not None and edge.parent:
                found.append(edge.parent)
        return found

    def frames(self) -> dict[str, FrameInfo]:
        """The figures of every child frame, sorted by name."""
        with self.lock:
            return {child: tree.info_of(edge) for child, edge in sorted(self._edges.items()) if edge.parent}

    # All below: callers hold the lock.

    def _forget_paths(self) -> None:
        self._paths.clear()
        self._groups.clear()
        self._moving = None
        self.version += 1

    def _take(self, transforms: TransformRows, authority: Any, latest: int) -> Iterator[TransformStamped]:
        """Store the usual samples of a message that is not decoded. Yield, in their turn, the others and those that are
        later than `latest`."""
        at = 0
        while True:
            if self._moving is None:
                self._moving = Edges(edge for edge in self._edges.values() if not edge.static)
            at, repeated = self._moving.take(transforms.rows, at, authority, latest)
            self.duplicates += repeated
            if at == len(transforms):
                return
            yield transforms[at]
            at += 1

    def _put(
        self, child: str, parent: str, stamp: int, floats: Floats, authority: str, *, static: bool = False
    ) -> Rejection | None:
        """Store a sample, or a static transform; None, or why it was refused. Names may have a leading slash."""
        child, parent = strip_slash(child), strip_slash(parent)
        refused = tree.check_sample(parent, child, floats, authority)
        if refused is not None:
            return refused
        floats = tree.normalise(floats)
        edge = self._edges.get(child)
        if edge is not None and edge.parent and not static:
            if edge.static:
                text = f"{child} is static by {edge.authority}: {authority}'s sample is refused"
                return Rejection("TF_STATIC_FRAME", text)
            if edge.newest > stamp + self._cache:
                text = f"{child} from {authority} is older than the cache of {self._cache / 1e9} s"
                return Rejection("TF_OLD_DATA", text)
            known = edge.find(stamp)
            if known == (stamp, parent, floats):
                self.duplicates += 1
                return None
            if known is not None:
                return Rejection("TF_REPEATED_DATA", f"{child} has a sample of {stamp / 1e9:.9f} s already")
        if (edge is None or edge.parent != parent) and child in self.chain(parent):
            other = self._edges[parent].authority if parent in self._edges else authority
            return Rejection("TF_LOOP", f"{parent} -> {child} by {authority} closes a loop with {other}'s transforms")
        if edge is None or not edge.parent or static:
            edge = self._edges[child] = Edge(self._names, child, self._cache, static)
        if edge.parent != parent or static:
            self._forget_paths()
        edge.insert(stamp, parent, floats, authority)
        self._frames.update((child, parent))
        return None

    def _latest(self, target: str, source: str) -> int:
        """The newest time that all moving edges between two frames have; raises where they are not connected."""
        path = self._paths.get((target, source)) or self._prepare(target, source)
        if path is not None:
            return path.newest
        if target != source:
            return tree.make_path(*self._find_edges(target, source)).newest
        edge = self._edges.get(target)
        return edge.newest if edge is not None else 0

    def _check_frames(self, **arguments: str) -> None:
        """Raise InvalidArgumentException or LookupException for names that no frame has."""
        for argument, name in arguments.items():
            if not name or name.startswith("/"):
                raise errors.InvalidArgumentException(
                    f"{argument}: {name!r} is no name of a frame: leave the slash out"
                )
        for argument, name in arguments.items():
            if name not in self._frames:
                raise errors.LookupException(f"{argument}: there is no frame {name!r}")

    def _solve(self, target: str, source: str, time: int) -> tuple[int, Answer]:
        """The time and target_from_source then (0 = the newest that all moving edges have); raises tf2's exceptions."""
        path = self._paths.get((target, source)) or self._prepare(target, source, time)
        if path is not None and (answer := path.solve(at := time or path.newest)) is not None:
            return at, answer
        time = time or self._latest(target, source)
        if target == source:
            return time, (*rigid.IDENTITY, 0.0)
        # The parents at that time may differ from the newest ones. Where an edge has no data, this raises.
        answer = tree.make_path(*self._find_edges(target, source, time)).solve(time)
        assert answer is not None
        return time, answer

    def _prepare(self, target: str, source: str, time: int = 0) -> FramePath | None:
        """The path by the newest parents; None if it does not hold at every time, or if there is one at times only."""
        if target == source:
            return None
        self._check_frames(target_frame=target, source_frame=source)
        try:
            up, down = self._find_edges(target, source)
        except errors.ConnectivityException:
            if not time:
                raise
            return None
        if not all(edge.has_one_parent for edge in (*up, *down)):
            # At other times the path was another one.
            return None
        path = self._paths[target, source] = tree.make_path(up, down)
        return path

    def _find_edges(self, target: str, source: str, time: int | None = None) -> tuple[list[Edge], list[Edge]]:
        """The edges up to the common ancestor, by the newest parents or those at `time`. Raises tf2's exceptions."""
        failures: list[errors.ExtrapolationException] = []

        def parent_of(frame: str) -> str:
            edge = self._edges.get(frame)
            if edge is None or time is None or edge.static:
                return edge.parent if edge is not None else ""
            if failure := tree.extrapolation(edge, time, f"between {target!r} and {source!r}"):
                failures.append(failure)
                return ""
            return edge[edge.before(time)].parent

        def climb(frame: str, ends: Container[str]) -> list[str]:
            found = [frame]
            while found[-1] not in ends and (parent := parent_of(found[-1])):
                found.append(parent)
                # The newest parents never form a loop, but parents at different times can.
                if len(found) > len(self._edges) + 1:
                    raise errors.LookupException(f"the frames above {frame!r} form a loop at that time")
            return found

        up = climb(source, ())
        down = climb(target, set(up))
        if down[-1] not in up:
            if failures:
                raise failures[-1]
            raise errors.ConnectivityException(f"no transforms connect {target!r} and {source!r}")
        return [self._edges[f] for f in up[: up.index(down[-1])]], [self._edges[f] for f in down[:-1]]


def _answers(look_up: Callable[..., object], *arguments: str | int) -> tuple[bool, str]:
    """Whether a look-up answers; if not, also its error text."""
    try:
        look_up(*arguments)
    except errors.TransformException as error:
        return False, str(error)
    return True, ""
