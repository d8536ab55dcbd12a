"""Where the sensors of all robots are mounted, and where they are in `map`."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from zteam.kernels.binding import Rays
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


def make_rays(at: Mounts) -> Rays:
    """Room for the sensors' rays."""
    x, y, yaw = np.empty((3, len(at.owner)))
    return Rays(x, y, at.z, yaw, at.owner)


def place_rays(poses: Floats, at: Mounts, rays: Rays) -> None:
    """Bring the sensors' rays to where they are with the robots at `poses` (rows x, y, yaw in `map`)."""
    x, y, yaw = poses.take(at.owner, axis=0).T
    cos, sin = np.cos(yaw), np.sin(yaw)
    rays.x[:] = x + cos * at.x - sin * at.y
    rays.y[:] = y + sin * at.x + cos * at.y
    rays.yaw[:] = yaw + at.yaw


def rays_of(poses: Floats, at: Mounts) -> Rays:
    """The sensors' rays with the robots at `poses` (rows x, y, yaw in `map`)."""
    rays = make_rays(at)
    place_rays(poses, at, rays)
    return rays
