"""The aggregator's bundles, of which a robot reads only the frames that it looks up.

A bundle holds the whole team. A follower needs two frames of it, and to decode the other ninety-eight of fifty robots'
takes most of its time. Usually every tick brings one bundle with the same frames in the same order. So payloads of one
layout are kept as they came, and a look-up reads its frames from those payloads that it has not read yet. A bundle of
another layout is decoded as a whole and begins a new list.
"""

import threading
from collections.abc import Iterable

from zteam.messages import TFMessage, decode, ns_from_time
from zteam.messages.tf_layout import Layout
from zteam.names import strip_slash
from zteam.tf.buffer import Buffer

_PRUNE = 64
"""Payloads between looks for those that are too old."""


class Bundles:
    """Bundles on their way into a buffer. Safe to use from several threads."""

    def __init__(self, buffer: Buffer, authority: str) -> None:
        self._buffer = buffer
        self._authority = authority
        self._lock = threading.Lock()
        self._payloads: list[bytes] = []
        """All of one layout, oldest first."""
        self._layout: Layout | None = None
        """None until a bundle came in which no frame is there twice."""
        self._indices: dict[str, int] = {}
        """Of each frame in the layout."""
        self._read: dict[str, int] = {}
        """How many of the payloads each frame has been read from."""
        self._paths: dict[tuple[str, str], list[str]] = {}

    def take(self, payload: bytes) -> int:
        """Keep or store a bundle that came; the stamp (ns) of its last transform, 0 if it is empty.

        Raises DecodeError.
        """
        with self._lock:
            if self._layout is None or not self._layout.fits(payload):
                return self._take_other(payload)
            self._payloads.append(payload)
            if len(self._payloads) % _PRUNE == 0:
                self._prune(self._layout)
            return self._layout.stamp(payload, -1)

    def _take_other(self, payload: bytes) -> int:
        """Store what is not read of the old layout, and all of a bundle of another one."""
        transforms = decode(TFMessage, payload).transforms
        self._settle(self._indices)
        for transform in transforms:
            self._buffer.set_transform(transform, self._authority)
        self._forget()
        if not transforms:
            return 0
        indices = {strip_slash(transform.child_frame_id): index for index, transform in enumerate(transforms)}
        if len(indices) == len(transforms):
            self._layout, self._indices, self._payloads = Layout(payload), indices, [payload]
            self._read = dict.fromkeys(indices, 1)
        return ns_from_time(transforms[-1].header.stamp)

    def settle(self, target_frame: str, source_frame: str) -> None:
        """Bring every frame between these two up to date in the buffer."""
        with self._lock:
            path = self._paths.get((target_frame, source_frame))
            if path is None:
                path = self._paths[target_frame, source_frame] = self._find_path(target_frame, source_frame)
            self._settle(path)

    def clear(self) -> None:
        """Forget what was not read: time has gone back."""
        with self._lock:
            self._forget()

    def forget_paths(self) -> None:
        """The tree's fixed part may have changed."""
        with self._lock:
            self._paths.clear()

    def _forget(self) -> None:
        self._payloads, self._layout, self._indices, self._read = [], None, {}, {}
        self._paths.clear()

    def _find_path(self, *frames: str) -> list[str]:
        """The frames from these up to their roots that are in the layout."""
        chains = (self._buffer.chain(frame) for frame in frames)
        return sorted(self._indices.keys() & {frame for chain in chains for frame in chain})

    def _settle(self, children: Iterable[str]) -> None:
        """Store what has not been read yet of these frames, which are all in the layout."""
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

    def _prune(self, layout: Layout) -> None:
        """Drop payloads that the buffer would not keep either."""
        oldest = layout.stamp(self._payloads[-1], -1) - self._buffer.cache
        cut = 0
        while layout.stamp(self._payloads[cut], -1) < oldest:
            cut += 1
        if cut:
            del self._payloads[:cut]
            self._read = {child: max(0, read - cut) for child, read in self._read.items()}
