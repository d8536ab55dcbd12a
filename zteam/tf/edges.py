"""The history of one edge of the tree."""

from bisect import bisect_left
from itertools import pairwise

from zteam.tf.rigid import Floats

Planar = tuple[float, float, float, float, float]
"""A transform that only turns about z: x, y, z, qz, qw. (Complex numbers were tried: Python is quicker with floats.)"""

Value = Planar | Floats


def as_floats(value: Value) -> Floats:
    """A value as seven floats."""
    if len(value) == 7:
        return value
    x, y, z, k, w = value
    return (x, y, z, 0.0, 0.0, k, w)


class Edge:
    """What is known of one child frame: a static transform, or samples in order of time."""

    __slots__ = ("authority", "expiry", "parent", "parents", "plain_parent", "spatial", "stamps", "static", "values")

    def __init__(self, static: bool) -> None:
        self.static = static
        self.stamps: list[int] = []
        self.values: list[Value] = []
        self.parent = ""
        """By the newest sample; empty if there is none."""
        self.parents: list[str] | None = None
        """By sample, where they differ; None where all samples have the same."""
        self.plain_parent: str | None = None
        """The parent, if all samples have it and the edge moves: what the usual sample is compared with."""
        self.spatial = 0
        """How many values are not planar."""
        self.expiry = 0
        """A sample of a later time than this ends the oldest one's life."""
        self.authority = ""

    def replace(self, value: Value, parent: str) -> None:
        """Hold one static transform."""
        self.stamps, self.values, self.parent, self.parents = [0], [value], parent, None
        self.spatial = len(value) == 7

    def forget(self) -> None:
        """Drop all samples."""
        self.stamps, self.values, self.parent, self.parents, self.spatial = [], [], "", None, 0
        self.plain_parent = None

    def shape(self) -> tuple[str, bool, bool, Value | None]:
        """All that paths rely on: while it is the same, they hold."""
        return (
            self.parent,
            self.parents is None,
            self.spatial == 0,
            self.values[0] if self.static and self.values else None,
        )

    def parent_at(self, index: int) -> str:
        """Parent of the sample at an index."""
        return self.parent if self.parents is None else self.parents[index]

    def insert(self, stamp: int, value: Value, parent: str, cache: int) -> None:
        """Put a sample in its place, and forget what is older than the newest by more than `cache` (ns).

        The stamp is not there yet.
        """
        stamps = self.stamps
        if self.parents is None and stamps and parent != self.parent:
            self.parents = [self.parent] * len(stamps)
        at = bisect_left(stamps, stamp)
        stamps.insert(at, stamp)
        self.values.insert(at, value)
        if self.parents is not None:
            self.parents.insert(at, parent)
            self.parent = self.parents[-1]
        else:
            self.parent = parent
        self.spatial += len(value) == 7
        self.plain_parent = self.parent if self.parents is None else None
        self.prune(cache)

    def prune(self, cache: int) -> None:
        """Forget what is older than the newest sample by more than `cache` (ns)."""
        cut = bisect_left(self.stamps, self.stamps[-1] - cache)
        self.expiry = self.stamps[cut] + cache
        if self.spatial:
            self.spatial -= sum(len(value) == 7 for value in self.values[:cut])
        del self.stamps[:cut]
        del self.values[:cut]
        if self.parents is not None:
            del self.parents[:cut]
            if all(a == b for a, b in pairwise(self.parents)):
                self.parents, self.plain_parent = None, self.parent

    def find(self, stamp: int) -> int:
        """Index of the sample with exactly this stamp, or -1."""
        at = bisect_left(self.stamps, stamp)
        return at if at < len(self.stamps) and self.stamps[at] == stamp else -1
