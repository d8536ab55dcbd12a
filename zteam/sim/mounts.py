"""Where the sensors of all robots are mounted, and where they are in `map`."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from zteam.kernels.binding import Rays, place_mounts
from zteam.world.model import Device

Floats = NDArray[np.float64]

Mounts = Rays
"""In the robots' base frames."""


def mount_devices(owned: Sequence[tuple[int, Device]]) -> Mounts:
    """Where the robots' devices stand, by the robots' indexes."""
    x, y, z, yaw = np.array([(d.x, d.y, d.z, d.yaw) for _, d in owned], float).reshape(-1, 4).T
    return Mounts(np.stack((x, y, yaw)), z.copy(), np.array([owner for owner, _ in owned], np.int64))


def rays_of(poses: Floats, at: Mounts) -> Rays:
    """The sensors' rays with the robots at `poses` (rows x, y, yaw in `map`)."""
    rays = at._replace(at=np.empty_like(at.at))
    place_mounts(at, poses, rays)
    return rays
