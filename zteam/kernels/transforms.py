"""Rigid transforms, edges of a tree of frames over time and the bytes of `tf` (transforms.c). As `binding.py` says.

A transform is seven numbers: x, y, z in metres and a unit quaternion x, y, z, w. Times are in ns.
"""

import math
from collections.abc import Iterable, Sequence
from struct import Struct
from typing import Any, NamedTuple

from zteam.kernels.binding import ffi, lib

Floats = tuple[float, float, float, float, float, float, float]
"""x, y, z, qx, qy, qz, qw of parent_from_child."""
Answer = tuple[float, float, float, float, float, float, float, float]
"""The same of target_from_source, and its yaw (rad)."""
_read_seven, _read_eight, _read_row = Struct("7d").unpack, Struct("8d").unpack_from, Struct("7q7d").unpack_from
_ROW_SIZE = ffi.sizeof("tf_row")
NOT_KNOWN = -(2**63)
"""The stamp of a pose that is not known, whose numbers are NaN. For C its stamp is 0."""
_LEAST_SIZE = 72
"""Bytes of a TransformStamped without names."""
ROUNDING = 1e-15
"""A quaternion whose squared length differs from 1 by less than this is not scaled: that is the rounding of doubles."""


def compose(a_from_b: Floats, b_from_c: Floats) -> Floats:
    """a_from_c."""
    made = ffi.new("double[7]")
    lib.compose(a_from_b, b_from_c, made)
    return _read_seven(ffi.buffer(made))


def invert(a_from_b: Floats) -> Floats:
    """b_from_a."""
    made = ffi.new("double[7]")
    lib.invert(a_from_b, made)
    return _read_seven(ffi.buffer(made))


def gather_poses(found: Sequence[tuple[Sequence[float], int] | None]) -> tuple[Any, Any]:
    """Planar poses (x, y, yaw; m, rad) with their stamps as `Paths.solve` gives them; None is one that is not known."""
    nowhere = math.nan, math.nan, math.nan, 0.0
    poses = [number for each in found for number in ((*each[0], each[1]) if each else nowhere)]
    stamps = [each[1] if each else NOT_KNOWN for each in found]
    return ffi.new("double[]", poses), ffi.new("int64_t[]", stamps)


class Names(dict[str, Any]):
    """Names of frames and of senders for C: each has one place in memory as long as this object lives."""

    def __init__(self) -> None:
        self._texts: list[Any] = []

    def __missing__(self, name: str) -> Any:
        data = name.encode()
        self._texts.append(ffi.new("uint8_t[]", data))
        place = self[name] = ffi.new("tf_name *", (self._texts[-1], len(data)))
        return place


class Sample(NamedTuple):
    stamp: int
    parent: str
    pose: Floats
    """parent_from_child."""


class Edge:
    """The edge from one child frame to its parent: its samples by ascending stamps, or its static transform."""

    def __init__(self, names: Names, child: str, cache: int, static: bool = False) -> None:
        """Samples that are `cache` ns older than the newest one are forgotten."""
        self._names, self.static = names, static
        self.parent = ""
        """Of the newest sample."""
        self.edge = ffi.gc(ffi.new("tf_edge *"), lib.free_samples)
        """For C."""
        self.edge.child, self.edge.cache, self.edge.is_static = names[child], cache, static

    def __len__(self) -> int:
        return int(self.edge.count)

    def __getitem__(self, at: int) -> Sample:
        """A sample by its place in time; -1 is the newest one. Raises IndexError."""
        row, place = self.edge, at + len(self) if at < 0 else at
        if not 0 <= place < row.count:
            raise IndexError(at)
        found = row.samples[row.first + place]
        return Sample(found.stamp, _text(found.parent), _read_seven(ffi.buffer(found.pose)))

    @property
    def authority(self) -> str:
        """The sender of the sample that came last."""
        return _text(self.edge.authority)

    @property
    def newest(self) -> int:
        """The stamp of the newest sample; 0 without one."""
        row = self.edge
        return row.samples[row.first + row.count - 1].stamp if row.count else 0

    @property
    def has_one_parent(self) -> bool:
        """Whether all samples have the same parent."""
        return bool(lib.has_one_parent(self.edge))

    def before(self, time: int) -> int:
        """The place of the newest sample that is not newer than `time`; -1 without one."""
        return int(lib.count_before(self.edge, time + 1)) - 1

    def find(self, stamp: int) -> Sample | None:
        """The sample with exactly this stamp."""
        at = self.before(stamp)
        found = self[at] if at >= 0 else None
        return found if found is not None and found.stamp == stamp else None

    def insert(self, stamp: int, parent: str, pose: Floats, authority: str) -> None:
        """Insert a sample whose stamp is new."""
        if not lib.add_sample(self.edge, stamp, self._names[parent], pose):
            raise MemoryError
        self.edge.authority = self._names[authority]
        self.parent = self[-1].parent


take_sample = lib.take_sample
"""`take_sample(edge.edge, stamp, pose, authority)` inserts a usual sample and returns 1: it has the parent of the
newest one, is newer, and has finite numbers and a unit quaternion. The newest one again: 0. Any other is not stored:
-1. It is C's own function, because a layer of Python would take as long."""


def _text(name: Any) -> str:
    return bytes(ffi.buffer(name.text, name.size)).decode() if name else ""


class FramePath:
    """The path from a source to a target; it holds while its edges keep their parents."""

    def __init__(self, first: Floats, steps: Sequence[tuple[Edge, bool, Floats]]) -> None:
        """The static transform before the first moving edge; each such edge, whether the path leads down it, and the
        static transform after it."""
        self._edges = [edge for edge, *_ in steps]
        self._steps = ffi.new("tf_step[]", [(edge.edge, is_down, after) for edge, is_down, after in steps])
        self.path = ffi.new("tf_path *", (first, self._steps, len(steps)))
        """For C."""

    @property
    def newest(self) -> int:
        """The newest time that all moving edges have; 0 if none moves. Stamps of 0 do not count, as in tf2."""
        return int(lib.newest_time(self.path))

    def solve(self, time: int) -> Answer | None:
        """target_from_source at `time`; None if a moving edge has no data for it."""
        found = ffi.new("double[8]")
        try:
            return _read_eight(ffi.buffer(found)) if lib.solve_path(self.path, time, found) else None
        except OverflowError:
            # No stamp is so far away.
            return None


class Paths:
    """Paths whose newest poses are found together."""

    def __init__(self, paths: Iterable[FramePath]) -> None:
        self._paths = list(paths)
        self._array = ffi.new("tf_path *[]", [path.path for path in self._paths])

    def solve(self) -> tuple[Any, Any, int]:
        """(paths, 4) doubles for C, x, y (m), yaw (rad), stamp (ns); the stamps; how many poses are not known."""
        count = len(self._paths)
        poses, stamps = ffi.new("double[]", 4 * count), ffi.new("int64_t[]", count)
        return poses, stamps, lib.solve_newest(self._array, count, poses, stamps)


class Edges:
    """Edges that take the transforms of a message together."""

    def __init__(self, edges: Iterable[Edge]) -> None:
        self._edges = list(edges)
        self._array = ffi.new("tf_edge *[]", [edge.edge for edge in self._edges])
        self._repeated = ffi.new("int64_t *")

    def take(self, rows: "Rows", start: int, authority: Any, latest: int) -> tuple[int, int]:
        """`take_sample` each of `rows` from `start` on until one is not usual or is later than `latest`: which one, and
        how many came again."""
        self._repeated[0] = 0
        at = lib.take_transforms(
            self._array, len(self._edges), rows.payload, rows.rows, start, len(rows), authority, latest, self._repeated
        )
        return at, self._repeated[0]


class Rows:
    """The transforms of a message, as they stand in its bytes."""

    def __init__(self, payload: bytes, rows: Any) -> None:
        self.payload, self.rows, self._data = payload, rows, ffi.buffer(rows)
        """For C: the bytes, and where in them is what."""

    def __len__(self) -> int:
        return len(self.rows)

    def __getitem__(self, at: int) -> tuple[int, int, str, str, float, float, float, float, float, float, float]:
        """Seconds and nanoseconds of the stamp, parent, child, and parent_from_child."""
        _, sec, nanosec, parent, parent_size, child, child_size, *pose = _read_row(self._data, _ROW_SIZE * at)
        read = self.payload
        return (
            sec, nanosec, read[parent : parent + parent_size].decode(), read[child : child + child_size].decode(), *pose
        )  # fmt: skip


def read_transforms(payload: bytes, at: int, end: int, count: int) -> tuple[Rows, int] | None:
    """Read `count` TransformStamped from little-endian CDR, from byte `at` on. Return them and the byte after the last.

    Return None for a payload that is cut, a name that is not ASCII, or a number that is not finite.
    """
    if count * _LEAST_SIZE > end - at:
        return None
    rows = ffi.new("tf_row[]", count)
    end = lib.read_transforms(payload, at, end, count, rows)
    return None if end < 0 else (Rows(payload, rows), end)
