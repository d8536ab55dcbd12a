"""The world as one occupancy grid."""

import math

import numpy as np

from zteam import names
from zteam.geometry import Pose2
from zteam.messages import Header, MapMetaData, OccupancyGrid, Point, Pose, time_from_ns
from zteam.world.model import Shape, World

_STRIP = 64
"""Rows of a map that are drawn at once."""


def map_message(world: World, resolution: float) -> OccupancyGrid:
    """Everything that stands still, on one axis-aligned grid of square cells of `resolution` metres.

    A cell is 100 where its centre lies in an occupied cell of a bitmap or in an obstacle's outline, else 0.
    """
    corners = [corner for plan in world.floorplans for corner in _plan_corners(plan.pose, plan.occupied, plan.cell)]
    fixed = [obstacle for obstacle in world.obstacles if obstacle.mass is None]
    outlines = [(shape, _polygon(obstacle.pose, shape)) for obstacle in fixed for shape in obstacle.shapes]
    corners += [(float(px), float(py)) for _, polygon in outlines for px, py in polygon]
    corners += [robot.pose[:2] for robot in world.robots] if not corners else []
    low, high = np.min(corners, axis=0), np.max(corners, axis=0)
    columns, rows = (max(1, math.ceil(n)) for n in (high - low) / resolution - 1e-9)
    x = low[0] + (np.arange(columns) + 0.5) * resolution
    y = low[1] + (np.arange(rows) + 0.5) * resolution
    grid = np.zeros((rows, columns), np.int8)
    for plan in world.floorplans:
        # In strips: whole arrays of coordinates would be the largest thing that a simulator ever holds.
        for first in range(0, rows, _STRIP):
            strip = slice(first, first + _STRIP)
            _draw_plan(grid[strip], x, y[strip], plan.pose, plan.occupied, plan.cell)
    for _, polygon in outlines:
        _draw_polygon(grid, x, y, polygon)
    info = MapMetaData(
        resolution=resolution, width=columns, height=rows, origin=Pose(Point(float(low[0]), float(low[1]), 0.0))
    )
    return OccupancyGrid(Header(time_from_ns(0), names.MAP_FRAME), info, grid.ravel())


def _plan_corners(pose: Pose2, occupied: np.ndarray, cell: tuple[float, float]) -> list[tuple[float, float]]:
    rows, columns = occupied.shape
    cos, sin = math.cos(pose.yaw), math.sin(pose.yaw)
    ends = [(u * columns * cell[0], v * rows * cell[1]) for u in (0, 1) for v in (0, 1)]
    return [(pose.x + cos * u - sin * v, pose.y + sin * u + cos * v) for u, v in ends]


def _draw_plan(
    grid: np.ndarray, x: np.ndarray, y: np.ndarray, pose: Pose2, occupied: np.ndarray, cell: tuple[float, float]
) -> None:
    cos, sin = math.cos(pose.yaw), math.sin(pose.yaw)
    dx, dy = x[None, :] - pose.x, y[:, None] - pose.y
    column = np.floor((cos * dx + sin * dy) / cell[0]).astype(np.int32)
    row = np.floor((cos * dy - sin * dx) / cell[1]).astype(np.int32)
    rows, columns = occupied.shape
    inside = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
    grid[inside] |= np.where(occupied[row[inside], column[inside]], 100, 0).astype(np.int8)


def _polygon(pose: Pose2, shape: Shape) -> np.ndarray:
    cos, sin = math.cos(pose.yaw), math.sin(pose.yaw)
    points = np.array(shape.points, float)
    return np.stack(
        (pose.x + cos * points[:, 0] - sin * points[:, 1], pose.y + sin * points[:, 0] + cos * points[:, 1]), axis=1
    )


def _draw_polygon(grid: np.ndarray, x: np.ndarray, y: np.ndarray, polygon: np.ndarray) -> None:
    """Even-odd rule over the cells in the polygon's box."""
    (left, bottom), (right, top) = polygon.min(axis=0), polygon.max(axis=0)
    columns = slice(np.searchsorted(x, left), np.searchsorted(x, right))
    rows = slice(np.searchsorted(y, bottom), np.searchsorted(y, top))
    px, py = x[columns][None, :], y[rows][:, None]
    inside = np.zeros((py.shape[0], px.shape[1]), bool)
    for (ax, ay), (bx, by) in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        if ay != by:
            crosses = (ay > py) != (by > py)
            inside ^= crosses & (px < ax + (py - ay) * (bx - ax) / (by - ay))
    grid[rows, columns][inside] = 100
