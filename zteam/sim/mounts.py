"""Where the sensors of all robots are mounted, and where they are in `map`."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from zteam.sim.casting import Rays
from zteam.sim.jit import compiled
from zteam.world.model import Device

Floats = NDArray[np.float64]


class Mounts(NamedTuple):
    """Sensors as arrays: poses in their robots' base frames, heights absolute."""

    x: Floats
    y: Floats
    z: Floats
    yaw: Floats
    owner: NDArray[np.int64]


def mount_devices(owned: Sequence[tuple[int, Device]]) -> Mounts:
    """Where the robots' devices stand, by the robots' indexes."""
    x, y, z, yaw = np.array([(d.x, d.y, d.z, d.yaw) for _, d in owned], float).reshape(-1, 4).T.copy()
    return Mounts(x, y, z, yaw, np.array([owner for owner, _ in owned], np.int64))


@compiled
def place_mounts(poses: Floats, at: Mounts, x: Floats, y: Floats, yaw: Floats) -> None:
    """Poses of sensors in `map`, into `x, y, yaw`."""
    for i in range(at.owner.shape[0]):
        owner = at.owner[i]
        heading = poses[owner, 2]
        cos, sin = math.cos(heading), math.sin(heading)
        x[i] = poses[owner, 0] + cos * at.x[i] - sin * at.y[i]
        y[i] = poses[owner, 1] + sin * at.x[i] + cos * at.y[i]
        yaw[i] = heading + at.yaw[i]


def make_rays(at: Mounts) -> Rays:
    """Room for the sensors' rays."""
    x, y, yaw = np.empty((3, len(at.owner)))
    return Rays(x, y, at.z, yaw, at.owner)


def rays_of(poses: Floats, at: Mounts) -> Rays:
    """The sensors' rays with the robots at `poses` (rows x, y, yaw in `map`)."""
    rays = make_rays(at)
    place_mounts(poses, at, rays.x, rays.y, rays.yaw)
    return rays
