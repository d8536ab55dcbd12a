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

from zteam.kernels import view as kernels


class Ranges(NamedTuple):
    """The ranges of a scan, or of some of its beams, read."""

    distances: NDArray[np.float64]
    """Metres: NaN where the beam says nothing, inf where it met nothing, 0 where something is too close to measure."""
    nearest: float
    """No hit is nearer (metres)."""
    silent: int
    """How many beams say nothing."""


def read_ranges(ranges: ArrayLike, range_min: float, range_max: float) -> Ranges:
    """The ranges (n,) of a LaserScan with these limits, all in metres. The array given is left alone."""
    return Ranges(*kernels.read_ranges(np.ascontiguousarray(ranges, np.float32), range_min, range_max)[:3])
