"""The samples of one child frame in order of time, or its static transform (tf2's TimeCache and StaticCache).

Nearly all robots move in a plane, so an edge keeps its samples in one of two forms. While the edge rotates about z only
and its z is constant, a sample is two complex numbers (see `pack`). Otherwise it is seven floats.

New planar samples are kept raw until a look-up needs them, because in a large team most frames are never looked up.

Callers hold the buffer's lock.
"""

from bisect import bisect_left
from cmath import sqrt
from typing import Any, NamedTuple

from zteam.tf.rigid import Floats

History = tuple[list[int], list[Any], list[complex]]
"""Ascending stamps in ns; then places and turns of planar samples, or tuples of seven floats and an empty list."""


def is_planar(floats: Floats) -> bool:
    """Whether a transform rotates about z only."""
    return floats[3] == 0.0 == floats[4]


def pack(floats: Floats) -> tuple[complex, complex]:
    """Place (x + iy) and turn of a planar transform, which maps a point p to place + turn * p."""
    x, y, _, _, _, k, w = floats
    half = complex(w, k)
    return complex(x, y), half * half


def unpack(place: complex, turn: complex, z: float) -> Floats:
    """The inverse of `pack`: seven floats; the quaternion has w >= 0."""
    half = sqrt(turn)
    return place.real, place.imag, z, 0.0, 0.0, half.imag, half.real


class FrameInfo(NamedTuple):
    """The figures of one child frame; times in ns, rate in Hz."""

    parent: str
    authority: str
    static: bool
    rate: float
    oldest: int
    newest: int
    samples: int


class TimeCache:
    """The edge from one child frame to its parent: all its samples, or its static transform."""

    __slots__ = (
        *("authority", "due", "fresh", "newest", "parent", "parents", "plain_parent"),
        *("planar", "settled", "static", "z"),
    )

    def __init__(self, static: bool, planar: bool, z: float = 0.0) -> None:
        self.static = static
        self.planar = planar
        """Whether the samples have the planar form."""
        self.z = z
        """The z of all samples, if they are planar."""
        self.parent = ""
        """The parent in the newest sample; empty without a sample."""
        self.parents: list[str] | None = None
        """The parent of every sample, or None if all have the same one."""
        self.authority = ""
        self.settled: History = ([], [], [])
        """All samples except the fresh ones; read `history` to get all."""
        self.fresh: list[Any] = []
        """The raw samples: stamp, x, y, qz, qw, stamp, …; each is newer than all before it."""
        self.newest = 0
        self.due = 0
        """A sample newer than this prunes the history; until then it may hold samples older than the cache."""
        self.plain_parent: str | None = None
        """The parent that the next planar sample must have to be appended without further checks."""

    def settle(self) -> None:
        """Append the fresh samples to the history."""
        stamps, places, turns = self.settled
        for stamp, x, y, k, w in zip(*[iter(self.fresh)] * 5, strict=True):
            half = complex(w, k)
            stamps.append(stamp)
            places.append(complex(x, y))
            turns.append(half * half)
        self.fresh.clear()

    @property
    def history(self) -> History:
        """All samples."""
        if self.fresh:
            self.settle()
        return self.settled

    def fix(self, floats: Floats, parent: str) -> None:
        """Hold one static transform."""
        self.settled = ([0], [floats], [])
        self.parent = parent

    def insert(self, stamp: int, floats: Floats, parent: str, cache: int) -> None:
        """Insert a sample by its stamp. The caller checked that the stamp is new and that the sample fits the form."""
        stamps, places, turns = self.history
        at = bisect_left(stamps, stamp)
        if at == len(stamps):
            self.newest, self.parent = stamp, parent
        stamps.insert(at, stamp)
        if self.planar:
            place, turn = pack(floats)
            places.insert(at, place)
            turns.insert(at, turn)
        else:
            places.insert(at, floats)
        if self.parents is not None:
            self.parents.insert(at, parent)
        if at == 0 or stamp > self.due or self.parents is not None:
            self.prune(cache)
        self.plain_parent = self.parent if self.planar and self.parents is None else None

    def prune(self, cache: int) -> None:
        """Forget what is older than the cache, counted from the newest sample."""
        stamps, places, turns = self.history
        if self.static or not stamps:
            return
        cut = bisect_left(stamps, self.newest - cache)
        del stamps[:cut], places[:cut], turns[:cut]
        if self.parents is not None:
            del self.parents[:cut]
            if self.parents.count(self.parent) == len(self.parents):
                self.parents = None
                self.plain_parent = self.parent if self.planar else None
        first, slack = stamps[0], cache // 8
        # A short history gets no slack, so that its last two samples are never further apart than the cache.
        self.due = first + cache + (slack if self.newest >= first + slack else 0)

    def takes(self, floats: Floats) -> bool:
        """Whether a sample fits the edge's form."""
        return not self.planar or (is_planar(floats) and floats[2] == self.z)

    def find(self, stamp: int) -> int:
        """Index of the sample with exactly this stamp, or -1."""
        stamps = self.history[0]
        at = bisect_left(stamps, stamp)
        return at if at < len(stamps) and stamps[at] == stamp else -1

    def has(self, at: int, floats: Floats, parent: str) -> bool:
        """Whether the sample `at` has exactly this transform and parent."""
        _, places, turns = self.history
        same = (places[at], turns[at]) == pack(floats) if self.planar else places[at] == floats
        return same and self.takes(floats) and self.parent_of(at) == parent

    def floats_of(self, at: int) -> Floats:
        """The sample `at` as seven floats."""
        _, places, turns = self.history
        if self.planar:
            return unpack(places[at], turns[at], self.z)
        floats: Floats = places[at]
        return floats

    def info(self, cache: int) -> FrameInfo:
        """The edge's figures. The edge must have a sample."""
        self.prune(cache)
        stamps = self.history[0]
        oldest, newest, count = stamps[0], stamps[-1], len(stamps)
        rate = 0.0 if self.static or newest == oldest else (count - 1) * 1e9 / (newest - oldest)
        return FrameInfo(self.parent, self.authority, self.static, rate, oldest, newest, count)

    def parent_of(self, at: int) -> str:
        """The parent in the sample `at`."""
        return self.parents[at] if self.parents is not None else self.parent

    def reshape(self, planar: bool, mixed: bool) -> None:
        """Change the form of all samples (`planar`), or prepare for samples with several parents (`mixed`).

        A path that was prepared through this edge is no longer valid.
        """
        stamps = self.history[0]
        if planar != self.planar:
            self.settled = (stamps, [self.floats_of(at) for at in range(len(stamps))], [])
            self.planar = planar
        if mixed:
            self.parents = [self.parent] * len(stamps)
