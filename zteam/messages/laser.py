"""What the ranges of a laser scan mean: the one rule of all that reads scans.

It is that of REP 117 and of the comments of sensor_msgs/LaserScan ("values < range_min or > range_max should be
discarded"):

- `+inf`, and from simulators `range_max`: the beam met nothing, so all is free up to `range_max`.
- `-inf`: it met something too close to measure.
- from `range_min` up to `range_max`, and above 0: it met something there.
- everything else says nothing, neither that something is there nor that all is free: NaN, what is below `range_min`
  (0 among it), and finite values above `range_max`.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

_ROUNDING = 1e-6
"""Relative: limits and ranges may have been rounded to float32 or not."""


class Ranges(NamedTuple):
    """The ranges of a scan, or of some of its beams, read."""

    distances: NDArray[np.float64]
    """Metres: NaN where the beam says nothing, inf where it met nothing, 0 where something is too close to measure."""
    nearest: float
    """No hit is nearer (metres)."""
    all_speak: bool
    """Whether it is certain that every beam says something."""


def read_ranges(ranges: ArrayLike, range_min: float, range_max: float) -> Ranges:
    """The ranges (n,) of a LaserScan with these limits, all in metres. The array given is left alone."""
    distances = np.array(ranges, np.float64)
    if not distances.size:
        return Ranges(distances, np.inf, all_speak=True)
    # Both find a NaN first, and are several times as fast as `min` and `max`.
    low, high = distances.item(distances.argmin()), distances.item(distances.argmax())
    at_least, at_most = range_min * (1.0 - _ROUNDING), range_max * (1.0 + _ROUNDING)
    # A NaN fails the comparisons. Mostly every beam says something, and then no beam has to be looked at.
    all_speak = low > 0.0 and low >= at_least and high <= at_most
    if not all_speak:
        says = (distances > 0.0) & (distances >= at_least) & (distances <= at_most)
        np.putmask(distances, ~(says | np.isinf(distances)), np.nan)
    # A simulator without infinities writes range_max for "no hit".
    np.putmask(distances, distances >= range_max * (1.0 - _ROUNDING), np.inf)
    # What is too close to measure is -inf still.
    np.maximum(distances, 0.0, out=distances)
    return Ranges(distances, low if all_speak else 0.0, all_speak)
