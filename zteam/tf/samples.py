"""Transforms as seven floats, and the history of one edge. The hot path: no numpy, no objects."""

import math
from bisect import bisect_left
from itertools import pairwise
from typing import NamedTuple

Floats = tuple[float, float, float, float, float, float, float]
"""x, y, z, qx, qy, qz, qw of parent_from_child."""

IDENTITY: Floats = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)


def compose(a_from_b: Floats, b_from_c: Floats) -> Floats:
    """a_from_c."""
    x, y, z, i, j, k, w = a_from_b
    px, py, pz, qi, qj, qk, qw = b_from_c
    # v + 2 q × (q × v + w v): the rotation of a vector by a unit quaternion in 18 products.
    cx = j * pz - k * py + w * px
    cy = k * px - i * pz + w * py
    cz = i * py - j * px + w * pz
    return (
        x + px + 2.0 * (j * cz - k * cy),
        y + py + 2.0 * (k * cx - i * cz),
        z + pz + 2.0 * (i * cy - j * cx),
        w * qi + i * qw + j * qk - k * qj,
        w * qj + j * qw + k * qi - i * qk,
        w * qk + k * qw + i * qj - j * qi,
        w * qw - i * qi - j * qj - k * qk,
    )


def invert(a_from_b: Floats) -> Floats:
    """b_from_a."""
    x, y, z, i, j, k, w = a_from_b
    i, j, k = -i, -j, -k
    cx = j * z - k * y + w * x
    cy = k * x - i * z + w * y
    cz = i * y - j * x + w * z
    return (
        -x - 2.0 * (j * cz - k * cy),
        -y - 2.0 * (k * cx - i * cz),
        -z - 2.0 * (i * cy - j * cx),
        i,
        j,
        k,
        w,
    )


def interpolate(a: Floats, b: Floats, fraction: float) -> Floats:
    """Between two samples: straight line and the short great arc (slerp), as tf2."""
    ax, ay, az, ai, aj, ak, aw = a
    bx, by, bz, bi, bj, bk, bw = b
    dot = ai * bi + aj * bj + ak * bk + aw * bw
    sign = -1.0 if dot < 0.0 else 1.0
    dot *= sign
    if dot > 1.0 - 1e-12:
        # So near to each other that sin(angle) has no digits left; the straight line is exact here.
        fa, fb = 1.0 - fraction, fraction
    else:
        angle = math.acos(dot)
        scale = 1.0 / math.sin(angle)
        fa, fb = math.sin((1.0 - fraction) * angle) * scale, math.sin(fraction * angle) * scale
    fb *= sign
    rest = 1.0 - fraction
    return (
        rest * ax + fraction * bx,
        rest * ay + fraction * by,
        rest * az + fraction * bz,
        fa * ai + fb * bi,
        fa * aj + fb * bj,
        fa * ak + fb * bk,
        fa * aw + fb * bw,
    )


class Sample(NamedTuple):
    """One transform of an edge at one time."""

    floats: Floats
    parent: str
    authority: str


class Edge:
    """What is known of one child frame: a static transform, or samples in order of time."""

    __slots__ = ("authority", "parents", "samples", "stamps", "static")

    def __init__(self, static: bool) -> None:
        self.static = static
        self.stamps: list[int] = []
        self.samples: list[Sample] = []
        self.parents = 0
        """How many times the parent changes within the history."""
        self.authority = ""

    @property
    def parent(self) -> str:
        """The parent by the newest sample; empty if there is none."""
        return self.samples[-1].parent if self.samples else ""

    def replace(self, sample: Sample) -> None:
        """Hold one static transform."""
        self.stamps, self.samples = [0], [sample]

    def insert(self, stamp: int, sample: Sample) -> None:
        """Put a sample in its place; the stamp is not there yet."""
        stamps = self.stamps
        if not stamps or stamp > stamps[-1]:
            changed = bool(stamps) and self.samples[-1].parent != sample.parent
            stamps.append(stamp)
            self.samples.append(sample)
            self.parents += changed
        else:
            at = bisect_left(stamps, stamp)
            stamps.insert(at, stamp)
            self.samples.insert(at, sample)
            self.parents += self._changes(at - 1, at + 1) - (
                0 < at < len(stamps) - 1 and self.samples[at - 1].parent != self.samples[at + 1].parent
            )

    def prune(self, oldest: int) -> None:
        """Forget what is older than `oldest`."""
        stamps = self.stamps
        if stamps[0] >= oldest:
            return
        cut = bisect_left(stamps, oldest)
        if self.parents:
            self.parents -= self._changes(0, cut)
        del stamps[:cut]
        del self.samples[:cut]

    def find(self, stamp: int) -> int:
        """Index of the sample with exactly this stamp, or -1."""
        at = bisect_left(self.stamps, stamp)
        return at if at < len(self.stamps) and self.stamps[at] == stamp else -1

    def _changes(self, first: int, last: int) -> int:
        """How often the parent changes among the samples `first` to `last`, both included, as far as they exist."""
        parents = [sample.parent for sample in self.samples[max(first, 0) : last + 1]]
        return sum(a != b for a, b in pairwise(parents))
