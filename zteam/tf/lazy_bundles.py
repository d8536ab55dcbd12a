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

    __slots__ = ("_indices", "_known", "_rule")

    def __init__(self, rule: PlanarRule, indices: tuple[int, ...]) -> None:
        self._rule, self._indices = rule, indices
        self._known: tuple[int, list[Planar | None], Pose2 | None] = 0, [], None
        """The number of the samples that were read last, what was read, and the pose.

        One value: the threads of several robots may ask. A plain tuple, because it is made for each look-up.
        """

    def find_pose(self, samples: _Samples) -> Pose2 | None:
        """The pose by the transforms of a payload: the same object while they say the same. None as of `_rule`."""
        number, before, pose = self._known
        if number == samples.number:
            return pose
        read = [samples[index] for index in self._indices]
        # Mostly a robot that is looked up stands.
        if read != before:
            pose = self._rule.pose(read)
        self._known = samples.number, read, pose
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
        self._buffer = buffer
        self._authority = authority
        self._lock = buffer.lock
        self._payloads: list[Any] = []
        """All of one layout, oldest first."""
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
            if self._layout is None or not self._layout.fits(payload):
                return self._take_other(payload)
            self._payloads.append(payload)
            if len(self._payloads) % _PRUNE == 0:
                self._prune(self._layout)
            self._take_samples(self._layout, payload)
            return 0 if self._last_base is None else self._layout.stamp(self._payloads[-1], self._last_base)

    def _take_other(self, payload: bytes | TFMessage) -> int:
        """Store all kept transforms of the old layout and then those of a bundle with another layout."""
        transforms = (payload if isinstance(payload, TFMessage) else decode(TFMessage, payload)).transforms
        self._settle(self._indices)
        for transform in transforms:
            self._buffer.set_transform(transform, self._authority)
        self._forget()
        if not transforms:
            return 0
        indices = {strip_slash(transform.child_frame_id): index for index, transform in enumerate(transforms)}
        if len(indices) == len(transforms):
            self._layout = MessageLayout(payload) if isinstance(payload, TFMessage) else Layout(payload)
            self._indices, self._payloads = indices, [payload]
            self._read = dict.fromkeys(indices, 1)
            self._take_samples(self._layout, payload)
        self._newest = max(self._newest, *(ns_from_time(transform.header.stamp) for transform in transforms))
        bases = [index for index, transform in enumerate(transforms) if is_base(transform)]
        self._last_base = bases[-1] if bases else None
        return ns_from_time(transforms[bases[-1]].header.stamp) if bases else 0

    def _take_samples(self, layout: Layout | MessageLayout, payload: Any) -> None:
        """Find out whether newest poses can be read straight from this payload."""
        oldest, newest = layout.span(payload)
        self._samples = _samples_of(layout, payload) if self._newest < oldest == newest else None
        self._newest = max(self._newest, newest)

    def lookup_pose2(self, target_frame: str, source_frame: str) -> tuple[Pose2, int]:
        """The newest planar pose of the source in the target and its stamp, as `Buffer.lookup_pose2` finds it."""
        key = target_frame, source_frame
        with self._lock:
            samples, route = self._samples, self._routes.get(key)
            # Bundles in between are not asked whether they fit: nothing older counts for the newest pose.
            if samples is not None and route is not None:
                pose = route.source.find_pose(samples) if route.path is self._buffer.paths.get(key) else None
                if pose is not None:
                    return pose, self._newest
            self.settle(target_frame, source_frame)
            answer = self._buffer.lookup_pose2(target_frame, source_frame, 0)
            self._keep_route(key)
            return answer

    def _keep_route(self, key: tuple[str, str]) -> None:
        """Remember the way of a look-up that has just been answered, if it leads over planar edges of the layout."""
        path, layout, known = self._buffer.paths.get(key), self._layout, self._routes.get(key)
        if not isinstance(path, PlanarPath) or layout is None:
            return
        if known is not None and known.path is path:
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
        self._payloads, self._layout, self._indices, self._read = [], None, {}, {}
        self._samples = None
        self._paths.clear()
        self._routes.clear()

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

    def _prune(self, layout: Layout | MessageLayout) -> None:
        """Drop payloads that are older than what the buffer remembers."""
        oldest = layout.stamp(self._payloads[-1], -1) - self._buffer.cache
        cut = 0
        while layout.stamp(self._payloads[cut], -1) < oldest:
            cut += 1
        if cut:
            del self._payloads[:cut]
            self._read = {child: max(0, read - cut) for child, read in self._read.items()}
