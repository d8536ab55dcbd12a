"""Poses and maps as messages, and in the plane: as Pose2, and as grids for planning and for files."""

import math

import numpy as np

from zteam import names
from zteam.errors import UsageError
from zteam.geometry import FAR, Pose2, yaw_from_quaternion
from zteam.messages import Header, MapMetaData, OccupancyGrid, Pose, Time
from zteam.messages.planar import pose_message
from zteam.navigation.planning.grid import GridMap, make_map

_RESOLUTIONS = 1e-4, 1e3
"""Metres a cell, the least and the most."""


def map_message(grid: GridMap) -> OccupancyGrid:
    """A map in the frame `map`, with stamp 0: it holds at all times."""
    frame = grid.frame
    info = MapMetaData(Time(), frame.resolution, frame.columns, frame.rows, pose_message(frame.origin))
    return OccupancyGrid(Header(Time(), names.MAP_FRAME), info, grid.cells.ravel())


def map_grid(message: OccupancyGrid) -> GridMap:
    """The grid of a map that came on the bus. Raises UsageError if its numbers do not fit each other."""
    info = message.info
    if message.data.size != info.width * info.height or not message.data.size:
        raise UsageError(f"the map has {message.data.size} cells, not {info.width} x {info.height}")
    origin = planar(info.origin)
    if origin is None:
        raise UsageError("the origin of the map is not finite, too far away, or no pose in the plane")
    # A resolution travels as a 32-bit number: 0.05 would come back as 0.05000000074505806.
    resolution = float(str(np.float32(info.resolution)))
    if not _RESOLUTIONS[0] <= resolution <= _RESOLUTIONS[1]:
        raise UsageError("the map has a resolution of {:g} m, not {:g} to {:g} m".format(resolution, *_RESOLUTIONS))
    try:
        return make_map(np.array(message.data, np.int8).reshape(info.height, info.width), resolution, origin)
    except ValueError as error:
        raise UsageError(f"the map cannot be used: {error}") from None


def planar(pose: Pose) -> Pose2 | None:
    """A pose of the wire in the plane; None if it is not finite, too far away, or its orientation is no rotation."""
    p, q = pose.position, pose.orientation
    norm = math.hypot(q.x, q.y, q.z, q.w)
    if not (abs(p.x) <= FAR and abs(p.y) <= FAR and 0.9 < norm < 1.1):
        return None
    return Pose2(p.x, p.y, yaw_from_quaternion(q.x / norm, q.y / norm, q.z / norm, q.w / norm))


def is_finite(pose: Pose) -> bool:
    p, q = pose.position, pose.orientation
    return all(map(math.isfinite, (p.x, p.y, p.z, q.x, q.y, q.z, q.w)))
