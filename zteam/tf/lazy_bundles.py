"""The aggregator's bundles: a robot decodes only the frames that it looks up.

A bundle holds the transforms of the whole team. With fifty robots it has a hundred frames, of which a follower needs
two; decoding the others would take most of its time. Usually each tick's bundle has the same frames in the same order,
which is called its layout. Payloads of one layout are kept as bytes. A look-up decodes its own frames from the payloads
that arrived since these frames were decoded last. A bundle of another layout is decoded as a whole and begins a new
list of payloads.
"""

import threading
from collections.abc import Iterable

from zteam.messages import TFMessage, decode, ns_from_time
from zteam.messages.tf_layout import Layout
from zteam.names import strip_slash
from zteam.tf.bases import is_base
from zteam.tf.buffer import Buffer

_PRUNE = 64
"""After this many payloads, those that are too old are dropped."""


class Bundles:
    """Bundles whose transforms are stored in a buffer when a look-up needs them. Thread-safe."""

    def __init__(self, buffer: Buffer, authority: str) -> None:
        self._buffer = buffer
        self._authority = authority
        self._lock = threading.Lock()
        self._payloads: list[bytes] = []
        """All of one layout, oldest first."""
        self._layout: Layout | None = None
        """None until a bundle arrives that has each of its frames once."""
        self._indices: dict[str, int] = {}
        """The position of each frame in the layout."""
        self._last_base: int | None = None
        """The position of the last base in the layout; None without one."""
        self._read: dict[str, int] = {}
        """For each frame, the number of payloads from which it has been decoded."""
        self._paths: dict[tuple[str, str], list[str]] = {}

    def take(self, payload: bytes) -> int:
        """Keep or store a bundle; return the stamp (ns) of its last base, 0 if it has none. Raises DecodeError."""
        with self._lock:
            if self._layout is None or not self._layout.fits(payload):
                return self._take_other(payload)
            self._payloads.append(payload)
            if len(self._payloads) % _PRUNE == 0:
                self._prune(self._layout)
            return 0 if self._last_base is None else self._layout.stamp(payload, self._last_base)

    def _take_other(self, payload: bytes) -> int:
        """Store all kept transforms of the old layout and then those of a bundle with another layout."""
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
        bases = [index for index, transform in enumerate(transforms) if is_base(transform)]
        self._last_base = bases[-1] if bases else None
        return ns_from_time(transforms[bases[-1]].header.stamp) if bases else 0

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

    def forget_paths(self) -> None:
        """Forget which frames each look-up needs, because static transforms may have changed."""
        with self._lock:
            self._paths.clear()

    def _forget(self) -> None:
        self._payloads, self._layout, self._indices, self._read = [], None, {}, {}
        self._paths.clear()

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

    def _prune(self, layout: Layout) -> None:
        """Drop payloads that are older than what the buffer remembers."""
        oldest = layout.stamp(self._payloads[-1], -1) - self._buffer.cache
        cut = 0
        while layout.stamp(self._payloads[cut], -1) < oldest:
            cut += 1
        if cut:
            del self._payloads[:cut]
            self._read = {child: max(0, read - cut) for child, read in self._read.items()}
