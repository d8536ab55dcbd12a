"""The aggregator's bundles: a robot decodes only the frames that it looks up.

A bundle holds the transforms of the whole team. With fifty robots it has a hundred frames, of which a follower needs
two; decoding the others would take most of its time. Usually each tick's bundle has the same frames in the same order,
which is called its layout. Payloads of one layout are kept as bytes, or as the messages that a bus in memory shares. A
look-up reads its own frames from the payloads that arrived since these frames were read last. A bundle of another
layout is read as a whole and begins a new list of payloads.

Usually all transforms of a bundle also have one stamp, which is newer than all before it. The newest pose is then read
straight from the newest payload, along the path that the buffer has prepared, and the buffer is not needed.
"""

from collections.abc import Iterable
from functools import lru_cache
from itertools import count
from typing import Any, NamedTuple

from zteam.geometry import Pose2
from zteam.messages import TFMessage, decode, ns_from_time
from zteam.messages.tf_layout import Layout, MessageLayout
from zteam.names import strip_slash
from zteam.tf.bases import is_base
from zteam.tf.buffer import Buffer
from zteam.tf.errors import TransformException
from zteam.tf.paths import Planar, PlanarPath, PlanarRule, read_planar

_PRUNE = 64
"""After this many payloads, those that are too old are dropped."""


_numbers = count(1)


class _Samples(dict[int, Planar | None]):
    """The transforms of one payload by their positions, each read when it is first asked for."""

    def __init__(self, layout: Layout | MessageLayout, payload: Any) -> None:
        self.payload = payload
        self.number = next(_numbers)
        """Which samples these are, counted in this process."""
        self._layout = layout

    def __missing__(self, index: int) -> Planar | None:
        found = self[index] = read_planar(self._layout.numbers(self.payload, index))
        return found


_shared: _Samples | None = None
"""Of the message that was taken last, which many receivers may share."""


def _samples_of(layout: Layout | MessageLayout, payload: Any) -> _Samples:
    global _shared
    known = _shared
    if known is None or known.payload is not payload:
        known = _shared = _Samples(layout, payload)
    return known


class _Source:
    """Makes poses of the transforms at some positions of a layout. Receivers of the same messages share it."""

    __slots__ = ("_indices", "_read", "_rule", "known")

    def __init__(self, rule: PlanarRule, indices: tuple[int, ...]) -> None:
        self._rule, self._indices = rule, indices
        self.known: tuple[int, Pose2 | None] = 0, None
        """The number of the samples that were read last, and the pose.

        One value: the threads of several robots may ask. A plain tuple, because it is made for each payload.
        """
        self._read: tuple[list[Planar | None], Pose2 | None] = [], None
        """What was read last, and the pose."""

    def read_pose(self, samples: _Samples) -> Pose2 | None:
        """The pose by the transforms of a payload: the same object while they say the same. None as of `_rule`."""
        read = [samples[index] for index in self._indices]
        before, pose = self._read
        # Mostly a robot that is looked up stands.
        if read != before:
            pose = self._rule.pose(read)
            self._read = read, pose
        self.known = samples.number, pose
        return pose


_source = lru_cache(maxsize=4096)(_Source)
"""One object for equal arguments."""


class _Route(NamedTuple):
    """What a look-up leads over."""

    path: PlanarPath
    """As the buffer has prepared it: it holds as long as the buffer keeps it."""
    source: _Source


class Bundles:
    """Bundles whose transforms are stored in a buffer when a look-up needs them. Thread-safe, by the buffer's lock."""

    def __init__(self, buffer: Buffer, authority: str) -> None:
        self._buffer, self._authority = buffer, authority
        self._lock, self._prepared = buffer.lock, buffer.paths
        self._payloads: list[Any] = []
        """All of one layout, oldest first."""
        self._ends: list[int] = []
        """The stamp (ns) of the last transform of each payload."""
        self._layout: Layout | MessageLayout | None = None
        """None until a bundle arrives that has each of its frames once."""
        self._indices: dict[str, int] = {}
        """The position of each frame in the layout."""
        self._last_base: int | None = None
        """The position of the last base in the layout; None without one."""
        self._read: dict[str, int] = {}
        """For each frame, the number of payloads from which it has been decoded."""
        self._paths: dict[tuple[str, str], list[str]] = {}
        self._newest = 0
        """The newest stamp of all bundles."""
        self._samples: _Samples | None = None
        """Of the newest payload; None unless all its stamps are the same and newer than any before."""
        self._routes: dict[tuple[str, str], _Route] = {}

    def take(self, payload: bytes | TFMessage) -> int:
        """Keep or store a bundle; return the stamp (ns) of its last base, 0 if it has none. Raises DecodeError."""
        with self._lock:
            layout = self._layout
            if layout is None or not layout.fits(payload):
                return self._take_other(payload)
            if len(self._payloads) % _PRUNE == 0:
                self._prune()
            return self._keep(layout, payload)

    def _take_other(self, payload: bytes | TFMessage) -> int:
        """Store all kept transforms of the old layout and then those of a bundle with another layout."""
        transforms = (payload if isinstance(payload, TFMessage) else decode(TFMessage, payload)).transforms
        self._settle(self._indices)
        for transform in transforms:
            self._buffer.set_transform(transform, self._authority)
        self._forget()
        if not transforms:
            return 0
        bases = [index for index, transform in enumerate(transforms) if is_base(transform)]
        self._last_base = bases[-1] if bases else None
        indices = {strip_slash(transform.child_frame_id): index for index, transform in enumerate(transforms)}
        if len(indices) == len(transforms):
            self._layout = MessageLayout(payload) if isinstance(payload, TFMessage) else Layout(payload)
            self._indices, self._read = indices, dict.fromkeys(indices, 1)
            self._keep(self._layout, payload)
        self._newest = max(self._newest, *(ns_from_time(transform.header.stamp) for transform in transforms))
        return ns_from_time(transforms[bases[-1]].header.stamp) if bases else 0

    def _keep(self, layout: Layout | MessageLayout, payload: Any) -> int:
        """Keep a payload of the layout, and find out whether newest poses can be read from it. Returns as `take`."""
        oldest, newest = layout.span(payload)
        self._payloads.append(payload)
        self._ends.append(newest if oldest == newest else layout.stamp(payload, -1))
        self._samples = _samples_of(layout, payload) if self._newest < oldest == newest else None
        self._newest = max(self._newest, newest)
        if self._last_base is None:
            return 0
        return newest if oldest == newest else layout.stamp(payload, self._last_base)

    def find_pose2(self, target_frame: str, source_frame: str) -> tuple[Pose2, int] | None:
        """What `Buffer.lookup_pose2` finds: the newest planar pose of the source in the target; None if it raises."""
        key = target_frame, source_frame
        with self._lock:
            samples, route = self._samples, self._routes.get(key)
            # Bundles in between are not asked whether they fit: nothing older counts for the newest pose.
            if samples is not None and route is not None and route.path is self._prepared.get(key):
                number, pose = route.source.known
                if number != samples.number:
                    pose = route.source.read_pose(samples)
                if pose is not None:
                    return pose, self._newest
            return self._search(key)

    def _search(self, key: tuple[str, str]) -> tuple[Pose2, int] | None:
        """As `find_pose2`, from the buffer."""
        self.settle(*key)
        try:
            answer = self._buffer.lookup_pose2(*key, 0)
        except TransformException:
            return None
        self._keep_route(key)
        return answer

    def _keep_route(self, key: tuple[str, str]) -> None:
        """Remember the way of a look-up that has just been answered, if it leads over planar edges of the layout."""
        path, layout, known = self._prepared.get(key), self._layout, self._routes.get(key)
        if not isinstance(path, PlanarPath) or layout is None or (known is not None and known.path is path):
            return
        parents, edges = layout.parents, self._buffer.edges
        found = {edges[c]: self._indices[c] for c in self._paths[key] if c in edges}
        if all(e in found and e.plain_parent == parents[found[e]] for e in path.edges):
            self._routes[key] = _Route(path, _source(path.rule, tuple([found[edge] for edge in path.edges])))

    def settle(self, target_frame: str, source_frame: str) -> None:
        """Store the kept transforms of every frame between these two in the buffer."""
        with self._lock:
            path = self._paths.get((target_frame, source_frame))
            if path is None:
                path = self._paths[target_frame, source_frame] = self._find_path(target_frame, source_frame)
            self._settle(path)

    def clear(self) -> None:
        """Forget all kept payloads, because time went back."""
        with self._lock:
            self._forget()
            self._newest = 0

    def forget_paths(self) -> None:
        """Forget which frames each look-up needs, because static transforms may have changed."""
        with self._lock:
            self._paths.clear()
            self._routes.clear()

    def _forget(self) -> None:
        self._payloads, self._ends, self._layout, self._indices, self._read = [], [], None, {}, {}
        self._samples = None
        self.forget_paths()

    def _find_path(self, *frames: str) -> list[str]:
        """Those of the frames and their ancestors that are in the layout."""
        chains = (self._buffer.chain(frame) for frame in frames)
        return sorted(self._indices.keys() & {frame for chain in chains for frame in chain})

    def _settle(self, children: Iterable[str]) -> None:
        """Store the transforms of these frames that were not decoded yet; all frames are in the layout."""
        layout, count = self._layout, len(self._payloads)
        if layout is None:
            return
        for child in children:
            first = self._read[child]
            if first < count:
                self._read[child] = count
                index = self._indices[child]
                for payload in self._payloads[first:]:
                    self._buffer.set_transform(layout.transform(payload, index), self._authority)

    def _prune(self) -> None:
        """Drop payloads that are older than what the buffer remembers."""
        oldest = self._ends[-1] - self._buffer.cache
        cut = next(i for i, end in enumerate(self._ends) if end >= oldest)
        if cut:
            del self._payloads[:cut], self._ends[:cut]
            self._read = {child: max(0, read - cut) for child, read in self._read.items()}
