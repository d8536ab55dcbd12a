"""The world as one occupancy grid."""

import math

import numpy as np

from zteam import names
from zteam.geometry import in_polygon, signed_area
from zteam.messages import Header, OccupancyGrid, time_from_ns
from zteam.simulator.world.model import Floorplan, World
from zteam.simulator.world.placing import MAX_MAP_CELLS, map_metadata, place_points, standing_polygons

_STRIP = 16
"""Rows of a map that are drawn at once: few enough that their arrays stay in the processor's cache."""


def map_message(world: World, resolution: float) -> OccupancyGrid:
    """Everything that stands still, on one axis-aligned grid of square cells of `resolution` metres.

    A cell is 100 where its centre lies in an occupied cell of a bitmap or in an obstacle's polygon, or where something
    thinner than a cell stands, else 0. Raises UsageError for a map of more than MAX_MAP_CELLS.
    """
    info = map_metadata(world, resolution, MAX_MAP_CELLS)
    columns, rows, low = info.width, info.height, np.array((info.origin.position.x, info.origin.position.y))
    x = low[0] + (np.arange(columns) + 0.5) * resolution
    y = low[1] + (np.arange(rows) + 0.5) * resolution
    grid = np.zeros((rows, columns), np.int8)
    for plan in world.floorplans:
        _draw_plan(grid, x, y, plan)
        if min(plan.cell) < resolution:
            middles = (np.argwhere(plan.occupied)[:, ::-1] + 0.5) * np.array(plan.cell)
            _mark(grid, low, resolution, *place_points(plan.pose, middles).T)
    for polygon in standing_polygons(world):
        _draw_polygon(grid, x, y, polygon)
        if _thickness(polygon) < resolution:
            _mark(grid, low, resolution, *_along(polygon, resolution))
    return OccupancyGrid(Header(time_from_ns(0), names.MAP_FRAME), info, grid.ravel())


def _draw_plan(grid: np.ndarray, x: np.ndarray, y: np.ndarray, plan: Floorplan) -> None:
    # With a free border, for all that lies outside.
    framed = np.pad(plan.occupied * np.int8(100), 1)
    cos, sin = math.cos(plan.pose.yaw), math.sin(plan.pose.yaw)
    # In strips: whole arrays of coordinates would be the largest thing that a simulator ever holds.
    for first in range(0, len(y), _STRIP):
        dx, dy = x[None, :] - plan.pose.x, y[first : first + _STRIP, None] - plan.pose.y
        # Without a turn the column depends on x alone and the row on y alone: then these are no whole grids.
        across, along = (cos * dx + sin * dy, cos * dy - sin * dx) if sin else (cos * dx, cos * dy)
        row, column = (
            np.clip(np.floor(places / size) + 1.0, 0.0, count - 1.0).astype(np.int32)
            for places, size, count in zip((along, across), plan.cell[::-1], framed.shape, strict=True)
        )
        grid[first : first + _STRIP] |= framed[row, column]


def _mark(grid: np.ndarray, low: np.ndarray, resolution: float, x: np.ndarray, y: np.ndarray) -> None:
    """Occupy the cells that hold these points."""
    rows, columns = grid.shape
    column = np.clip(((x - low[0]) / resolution).astype(np.int32), 0, columns - 1)
    row = np.clip(((y - low[1]) / resolution).astype(np.int32), 0, rows - 1)
    grid[row, column] = 100


def _thickness(polygon: np.ndarray) -> float:
    """About the width of something long."""
    around = np.hypot(*(np.roll(polygon, -1, axis=0) - polygon).T).sum()
    # Far from the origin, the products of coordinates would be rounded to square metres.
    return 2.0 * abs(signed_area((polygon - polygon[0]).tolist())) / float(around)


def _along(polygon: np.ndarray, resolution: float) -> tuple[np.ndarray, np.ndarray]:
    """Points along the edges, less than a cell apart, but for the corners, which belong to two cells or more."""
    points = []
    for start, end in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        count = 1 + math.ceil(2.0 * math.dist(start, end) / resolution)
        points.append(start + (end - start) * ((np.arange(count) + 0.5) / count)[:, None])
    x, y = np.concatenate(points).T
    return x, y


def _draw_polygon(grid: np.ndarray, x: np.ndarray, y: np.ndarray, polygon: np.ndarray) -> None:
    """Even-odd rule over the cells in the polygon's box."""
    (left, bottom), (right, top) = polygon.min(axis=0), polygon.max(axis=0)
    columns = slice(np.searchsorted(x, left), np.searchsorted(x, right))
    rows = slice(np.searchsorted(y, bottom), np.searchsorted(y, top))
    px, py = x[columns][None, :], y[rows][:, None]
    grid[rows, columns][in_polygon(polygon, px, py)] = 100
