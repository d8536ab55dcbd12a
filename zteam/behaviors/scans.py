"""Laser scans read with care: which beams say something, and what stands in a cone or a corridor.

What a range means follows REP 117 and the comments of sensor_msgs/LaserScan: +inf, and from simulators `range_max`, is
a beam that met nothing, -inf one that met something too close to measure, and NaN, values below `range_min` (0 among
them) and finite values above `range_max` say nothing at all. A beam that says nothing is neither an obstacle nor free.
"""

import math
from collections.abc import Sequence
from functools import lru_cache

import msgspec
import numpy as np
from numpy.typing import NDArray

from zteam.messages import LaserScan

Floats = NDArray[np.float64]

_ANGLE_TOLERANCE = 1e-5
"""Radians: the scan's angles are float32 sums, so a beam on the edge of a cone may come to lie beside it."""
_TOUCHING = 1e-6
"""Metres: where a hit that is too close to measure is taken to be."""
_ROUNDING = 1e-6
"""Relative: limits and ranges may have been rounded to float32 or not."""


class Cone(msgspec.Struct, frozen=True):
    """What the beams in a cone say."""

    nearest: float
    """Metres from the laser to the nearest hit; inf where nothing is hit."""
    bearing: float
    """Where that hit is: radians, left positive; 0 where nothing is hit."""
    invalid: float
    """Share of the cone's beams that say nothing, 0..1."""


class _Beams(msgspec.Struct, frozen=True, eq=False):
    """A scan read once."""

    angles: Floats
    ranges: Floats
    hit_x: Floats
    """Where the beams that hit something ended, in the laser's frame."""
    hit_y: Floats
    hit_distance: Floats


@lru_cache(maxsize=8)
def _directions(start: float, step: float, count: int) -> tuple[Floats, Floats, Floats]:
    """Angles in [-pi, pi) of a scan's beams, their cosines and sines: the same in every scan of a laser."""
    angles = np.remainder(start + step * np.arange(count) + math.pi, math.tau) - math.pi
    return angles, np.cos(angles), np.sin(angles)


def _read(scan: LaserScan) -> _Beams | None:
    ranges = np.array(scan.ranges, np.float64)
    step, start = scan.angle_increment, scan.angle_min
    if ranges.size == 0 or not (math.isfinite(start) and math.isfinite(step)) or (step == 0.0 and ranges.size > 1):
        return None
    angles, cos, sin = _directions(start, step, ranges.size)
    too_close = np.isneginf(ranges)
    # NaN fails both comparisons, and so says nothing either.
    in_range = (ranges >= scan.range_min * (1.0 - _ROUNDING)) & (ranges <= scan.range_max * (1.0 + _ROUNDING))
    says_something = (in_range | np.isposinf(ranges)) & (ranges > 0.0)
    ranges[~says_something] = np.nan
    # A simulator without infinities writes range_max for "no hit".
    ranges[ranges >= scan.range_max * (1.0 - _ROUNDING)] = np.inf
    ranges[too_close] = 0.0
    hit = np.isfinite(ranges)
    # A hit too close to measure still has the direction of its beam.
    distance = np.maximum(ranges[hit], _TOUCHING)
    return _Beams(angles, ranges, distance * cos[hit], distance * sin[hit], distance)


class _Newest:
    """The scan that was read last: a behaviour and the safety layer look at the same one several times."""

    scan: LaserScan | None = None
    beams: _Beams | None = None


def _beams_of(scan: LaserScan) -> _Beams | None:
    ranges = scan.ranges
    if not isinstance(ranges, np.ndarray) or ranges.flags.writeable:
        # It may still be changed.
        return _read(scan)
    if _Newest.scan is not scan:
        _Newest.scan, _Newest.beams = scan, _read(scan)
    return _Newest.beams


def read_beams(scan: LaserScan) -> tuple[Floats, Floats] | None:
    """Angles in [-pi, pi) from the laser's x axis and distances in metres, both (n,), or None where there are no beams.

    A distance is NaN where the beam says nothing, inf where it met nothing, 0 where something is too close to measure.
    Beams without usable angles are no beams. A scan may run either way round (`angle_increment` < 0) and beyond pi.
    """
    beams = _beams_of(scan)
    return None if beams is None else (beams.angles, beams.ranges)


def look_ahead(scan: LaserScan, half_angle: float) -> Cone | None:
    """What stands within `half_angle` (radians) of straight ahead, or None where no beam looks there."""
    beams = read_beams(scan)
    if beams is None:
        return None
    angles, ranges = beams
    inside = np.abs(angles) <= half_angle + _ANGLE_TOLERANCE
    beams_inside = int(inside.sum())
    if not beams_inside:
        return None
    silent = int(np.isnan(ranges[inside]).sum())
    # Beams outside and silent ones must not be taken for the nearest.
    distances = np.where(inside & ~np.isnan(ranges), ranges, math.inf)
    at = int(distances.argmin())
    nearest = float(distances[at])
    return Cone(nearest, float(angles[at]) if nearest < math.inf else 0.0, silent / beams_inside)


def look_along(scan: LaserScan, half_width: float, heading: float = 0.0) -> float:
    """Metres to the nearest hit in a corridor of 2 * `half_width` towards `heading` (rad), inf where it is clear."""
    beams = _beams_of(scan)
    if beams is None:
        return math.inf
    cos, sin = math.cos(heading), math.sin(heading)
    x = cos * beams.hit_x + sin * beams.hit_y
    ahead = (x > 0.0) & (np.abs(cos * beams.hit_y - sin * beams.hit_x) <= half_width)
    return float(np.min(x, where=ahead, initial=math.inf))


def first_clear(scan: LaserScan, half_width: float, headings: Sequence[float], reach: float) -> float | None:
    """The first of the `headings` (rad) along which a corridor of 2 * `half_width` is clear for `reach` metres.

    None if there is no such heading. The same as asking `look_along` for each, at the cost of one.
    """
    beams = _beams_of(scan)
    if beams is None or reach <= 0.0:
        return headings[0]
    # Only what is near can stand in any of the corridors, and mostly that is little.
    near = (beams.hit_distance < math.hypot(reach, half_width) * (1.0 + _ROUNDING)).nonzero()[0]
    if not near.size:
        return headings[0]
    hit_x, hit_y = beams.hit_x[near], beams.hit_y[near]
    for heading in headings:
        cos, sin = math.cos(heading), math.sin(heading)
        x = cos * hit_x + sin * hit_y
        blocked = (x > 0.0) & (x < reach) & (np.abs(cos * hit_y - sin * hit_x) <= half_width)
        if not blocked.any():
            return heading
    return None
