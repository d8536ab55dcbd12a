"""Maps as messages on the bus, and as grids for planning and for files."""

import numpy as np

from zteam import names
from zteam.errors import UsageError
from zteam.messages import Header, MapMetaData, OccupancyGrid, Time
from zteam.planning.grid import FREE, OCCUPIED, UNKNOWN, GridMap, make_map
from zteam.services.poses import planar, pose_message


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
        raise UsageError("the origin of the map is not finite, or no pose in the plane")
    # A resolution travels as a 32-bit number: 0.05 would come back as 0.05000000074505806.
    resolution = float(str(np.float32(info.resolution)))
    try:
        return make_map(np.array(message.data, np.int8).reshape(info.height, info.width), resolution, origin)
    except ValueError as error:
        raise UsageError(f"the map cannot be used: {error}") from None


def to_three_values(grid: GridMap, free: float, occupied: float) -> GridMap:
    """The map with cells that are free, occupied or unknown alone, as map_saver decides it.

    A cell is free up to the share `free` of occupancy and occupied from the share `occupied` on; what lies between is
    unknown.
    """
    cells = np.where(grid.cells >= 100.0 * occupied, OCCUPIED, UNKNOWN)
    cells = np.where((grid.cells >= 0) & (grid.cells <= 100.0 * free), FREE, cells)
    return make_map(cells.astype(np.int8), grid.frame.resolution, grid.frame.origin)
