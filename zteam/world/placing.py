"""Whether a robot can stand where somebody wants to put it: plain geometry, without the simulator's engine."""

from collections.abc import Iterable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from zteam.geometry import Pose2, inverse2
from zteam.world.model import Floorplan, Obstacle, Point2, Robot, Shape, World

Floats = NDArray[np.float64]
REACH = 1e6
"""Metres that the plain goes on in a world without a floor plan."""
_MARGIN = 1.0
"""Metres around everything there is that still belong to a world."""


def find_hindrance(world: World, robot: Robot, others: Iterable[Robot] = ()) -> str:
    """What keeps `robot` from standing at its pose, as `it …`; empty if nothing does. `others` are robots that stand.

    Touching is allowed, and so is overlapping by less than half a cell of a bitmap.
    """
    outside = _outside(world, robot.pose)
    if outside:
        return outside
    body = [(shape, _placed(robot.pose, shape)) for shape in robot.shapes if shape.obstacle]
    for plan in world.floorplans:
        if plan.obstacle and any(_overlap_heights(plan, shape) and _meets_plan(plan, at) for shape, at in body):
            return f"it would stand in the wall of {plan.name}"
    standing: list[Obstacle | Robot] = [*world.obstacles, *others]
    for owner in standing:
        for shape in owner.shapes:
            points = _placed(owner.pose, shape) if shape.obstacle else None
            if points is not None and any(_overlap_heights(shape, own) and _overlap(points, at) for own, at in body):
                return f"it would stand in {owner.name}"
    return ""


def _outside(world: World, pose: Pose2) -> str:
    """Only where a floor plan says how far the world reaches; anywhere else the plain goes on."""
    if not world.floorplans:
        return "" if max(abs(pose.x), abs(pose.y)) <= REACH else f"it is more than {REACH:g} m away"
    corners = np.vstack(list(_corners(world)))
    (left, bottom), (right, top) = corners.min(axis=0), corners.max(axis=0)
    if left - _MARGIN <= pose.x <= right + _MARGIN and bottom - _MARGIN <= pose.y <= top + _MARGIN:
        return ""
    return f"it is outside of the world (x {left:.1f} to {right:.1f}, y {bottom:.1f} to {top:.1f})"


def _corners(world: World) -> Iterator[Floats]:
    for plan in world.floorplans:
        rows, columns = plan.occupied.shape
        width, height = columns * plan.cell[0], rows * plan.cell[1]
        yield _moved(plan.pose, ((0.0, 0.0), (width, 0.0), (width, height), (0.0, height)))
    for obstacle in world.obstacles:
        for shape in obstacle.shapes:
            yield _placed(obstacle.pose, shape)


def _placed(pose: Pose2, shape: Shape) -> Floats:
    return _moved(pose, shape.points)


def _moved(pose: Pose2, points: Sequence[Point2] | Floats) -> Floats:
    """(n, 2): the points in the frame that `pose` is in."""
    cos, sin = np.cos(pose.yaw), np.sin(pose.yaw)
    turn: Floats = np.array(((cos, sin), (-sin, cos)))
    return np.asarray(points) @ turn + (pose.x, pose.y)


def _overlap_heights(one: Shape | Floorplan, other: Shape | Floorplan) -> bool:
    return one.z_min < other.z_max and other.z_min < one.z_max


def _meets_plan(plan: Floorplan, polygon: Floats) -> bool:
    """Whether the centre of an occupied cell lies in the polygon."""
    local = _moved(inverse2(plan.pose), polygon) / plan.cell
    rows, columns = plan.occupied.shape
    low = np.clip(np.floor(local.min(axis=0)), 0, (columns, rows)).astype(int)
    high = np.clip(np.ceil(local.max(axis=0)), 0, (columns, rows)).astype(int)
    row, column = np.nonzero(plan.occupied[low[1] : high[1], low[0] : high[0]])
    return bool(_contains(local, column + low[0] + 0.5, row + low[1] + 0.5).any())


def _contains(polygon: Floats, x: Floats, y: Floats) -> NDArray[np.bool_]:
    """For each point whether it lies in the polygon: an odd number of edges to its right."""
    inside = np.zeros(np.shape(x), bool)
    for (ax, ay), (bx, by) in zip(polygon, np.roll(polygon, 1, axis=0), strict=True):
        if ay != by:
            crosses = (ay > y) != (by > y)
            inside ^= crosses & (x < ax + (y - ay) * (bx - ax) / (by - ay))
    return inside


def _overlap(one: Floats, other: Floats) -> bool:
    """Whether two polygons share more than their edges."""
    if (one.max(axis=0) <= other.min(axis=0)).any() or (other.max(axis=0) <= one.min(axis=0)).any():
        return False
    # Centres and corners catch one inside the other, the edges all the rest.
    for a, b in ((one, other), (other, one)):
        probes = np.vstack((a.mean(axis=0), 0.999 * a + 0.001 * a.mean(axis=0)))
        if _contains(b, probes[:, 0], probes[:, 1]).any():
            return True
    return _edges_cross(one, other)


def _edges_cross(one: Floats, other: Floats) -> bool:
    a, b = one[:, None], np.roll(one, 1, axis=0)[:, None]
    c, d = other[None], np.roll(other, 1, axis=0)[None]
    return bool(((_side(a, b, c) * _side(a, b, d) < 0) & (_side(c, d, a) * _side(c, d, b) < 0)).any())


def _side(a: Floats, b: Floats, p: Floats) -> Floats:
    """Above 0 where `p` lies left of the line from `a` to `b`."""
    side: Floats = (b[..., 0] - a[..., 0]) * (p[..., 1] - a[..., 1]) - (b[..., 1] - a[..., 1]) * (p[..., 0] - a[..., 0])
    return side
