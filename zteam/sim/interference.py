"""Lasers that disturb each other (the option `dazzle`): which ones look into which."""

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from zteam.counter_random import mix64, stream
from zteam.geometry import Pose2
from zteam.kernels.binding import Beams, Fans, Rays
from zteam.sim.casting import Caster
from zteam.world.model import Ranger

SAME_HEIGHT = 0.05
"""Metres: lasers further apart in height do not meet."""


class Interference(NamedTuple):
    """When lasers disturb each other."""

    angle: float
    """Radians to either side of the other laser."""
    probability: float
    """Share of the scans in which two lasers in mutual sight meet."""


class Emitter(NamedTuple):
    """A laser that may disturb others and be disturbed; its pose is in `map`."""

    batch: int
    row: int
    state: int
    """State of its stream of randomness."""
    owner: int
    pose: Pose2
    ranger: Ranger


def find_interference(
    emitters: Sequence[Emitter], caster: Caster, interference: Interference, tick: int
) -> Iterator[tuple[Emitter, float, int]]:
    """(disturbed laser, bearing of the other in its frame, a random number) for all that meet in this tick."""
    pairs = [
        (a, b)
        for i, a in enumerate(emitters)
        for b in emitters[i + 1 :]
        if a.owner != b.owner and _may_meet(a, b, interference.angle)
    ]
    if not pairs:
        return
    for (a, b), clear in zip(pairs, _are_in_sight(pairs, caster), strict=True):
        draw = stream(a.state, b.state, tick)
        if clear and (draw >> 11) * 2.0**-53 < interference.probability:
            yield a, _bearing(a, b), mix64(draw + 1)
            yield b, _bearing(b, a), mix64(draw + 2)


def _bearing(a: Emitter, b: Emitter) -> float:
    return math.remainder(math.atan2(b.pose.y - a.pose.y, b.pose.x - a.pose.x) - a.pose.yaw, math.tau)


def _may_meet(a: Emitter, b: Emitter, angle: float) -> bool:
    distance = math.dist(a.pose[:2], b.pose[:2])
    near = 0.0 < distance < min(a.ranger.range_max, b.ranger.range_max) and abs(a.ranger.z - b.ranger.z) <= SAME_HEIGHT
    return near and all(abs(_bearing(u, v)) <= u.ranger.fov / 2 + angle for u, v in ((a, b), (b, a)))


def _are_in_sight(pairs: Sequence[tuple[Emitter, Emitter]], caster: Caster) -> list[bool]:
    """Whether nothing but the second laser's own robot stands on the way from the first."""
    start = np.array([(a.pose.x, a.pose.y, a.ranger.z) for a, _ in pairs])
    end = np.array([b.pose[:2] for _, b in pairs])
    way = end - start[:, :2]
    distance = np.hypot(way[:, 0], way[:, 1])
    owners = np.array([a.owner for a, _ in pairs], np.int64)
    ahead = Beams(np.ones((1, 1)), np.zeros((1, 1)), 0.0, 0.0, float(distance.max()) + 1.0)
    x, y, z = np.ascontiguousarray(start.T)
    rays = Rays(x, y, z, np.arctan2(way[:, 1], way[:, 0]), owners)
    ranges, hit = caster.cast(Fans(rays, ahead))
    reached = ranges[:, 0] >= distance - 1e-9
    other = caster.source_of[hit[:, 0]] == np.array([b.owner for _, b in pairs], np.int64)
    return [bool(r or o) for r, o in zip(reached, other, strict=True)]
