"""Whether there is room for a robot at its pose: inside the world, and outside of everything that collides.

Plain geometry in numpy: the launcher asks before a simulator runs, the engine asks with the poses of the moment.
"""

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from zteam.config.map_files import Grid
from zteam.errors import UsageError
from zteam.geometry import FAR, Point2, Pose2, in_polygon
from zteam.messages import MapMetaData, Point, Pose
from zteam.simulator.world.model import Floorplan, Robot, Shape, World

Floats = NDArray[np.float64]
MAX_MAP_CELLS = 64_000_000
"""A byte each: the message stays below the bus's largest payload."""
START_ROOM = 0.6
"""Metres of the free square in which a robot starts."""
WALL_RIM = 0.05
"""Metres that a robot may stand in the cells of a bitmap: poses measured by hand are no more exact, and a robot that
touches a wall sinks in as far (`zteam.simulator.core.dynamic`)."""
_TOUCH = 1e-6
"""Share by which a body is taken smaller: what only touches it is then apart."""


def find_hindrance(world: World, robot: Robot, others: Mapping[int, Robot]) -> str:
    """What keeps `robot` from standing at its pose, as `would stand …`; empty if nothing does. `others` are the robots
    that stand there, by id. Touching is allowed, and so are WALL_RIM metres of a bitmap's wall."""
    outside = _find_outside(world, robot.pose)
    if outside:
        return outside
    body = [(shape, place_shape(robot.pose, shape)) for shape in robot.shapes if shape.obstacle]
    for plan in world.floorplans:
        if plan.obstacle and any(_heights_overlap(plan, shape) and _meets_plan(plan, at) for shape, at in body):
            return f"would stand in a wall of {plan.name!r}"
    reach = _reach(robot.shapes)
    standing = [(repr(thing.name), thing.pose, thing.shapes) for thing in world.obstacles]
    standing += [(f"robot {robot_id}", other.pose, other.shapes) for robot_id, other in others.items()]
    for name, pose, shapes in standing:
        if math.dist(pose[:2], robot.pose[:2]) > reach + _reach(shapes):
            continue
        for shape in shapes:
            points = place_shape(pose, shape) if shape.obstacle else None
            if points is not None and any(_heights_overlap(shape, own) and _overlap(points, at) for own, at in body):
                return f"would stand in {name}"
    return ""


def find_places(occupied: Grid, cell: float, count: int) -> list[Point2]:
    """At most `count` places for robots, all over the free room of a bitmap with square cells of `cell` metres: x, y
    from its lower left corner. Room without a wall on each of its four sides is taken only if the rest is not enough.
    """
    side = max(1, math.ceil(START_ROOM / cell))
    rows, columns = (length // side for length in occupied.shape)
    taken = occupied[: rows * side, : columns * side].reshape(rows, side, columns, side).any(axis=(1, 3))
    inside = ~taken
    for axis in (0, 1):
        inside &= np.logical_or.accumulate(taken, axis) & np.flip(np.logical_or.accumulate(np.flip(taken), axis))
    found = np.argwhere(inside if np.count_nonzero(inside) >= count else ~taken)
    chosen = found[np.linspace(0, len(found) - 1, min(count, len(found))).round().astype(int)]
    return [(x, y) for y, x in ((chosen + 0.5) * (side * cell)).round(6).tolist()]


def find_misplaced(world: World) -> Iterator[tuple[int, str]]:
    """The world's own robots that have no room at their start poses, and what keeps each from standing there. Of two
    robots in the same place it is the second."""
    for robot_id, robot in enumerate(world.robots):
        hindrance = find_hindrance(world, robot, dict(enumerate(world.robots[:robot_id])))
        if hindrance:
            yield robot_id, f"it {hindrance}"


def find_bounds(world: World) -> tuple[Floats, Floats] | None:
    """Least and greatest x, y (m, in `map`) of everything that stands still; None if nothing does."""
    corners = [*map(plan_corners, world.floorplans), *standing_polygons(world)]
    return (np.vstack(corners).min(axis=0), np.vstack(corners).max(axis=0)) if corners else None


def least_cell(width: float, height: float) -> float:
    """Metres a cell, two digits rounded up, of which a map of this size has no more than MAX_MAP_CELLS."""
    return float(f"{1.05 * math.sqrt(width * height / MAX_MAP_CELLS):.2g}")


def map_metadata(world: World, resolution: float, most: float = math.inf) -> MapMetaData:
    """Origin and size of the map of everything that stands still. Raises UsageError for more than `most` cells."""
    # A world may be empty: its robots come later.
    corners = [robot.pose[:2] for robot in world.robots] or [(0.0, 0.0)]
    low, high = find_bounds(world) or (np.min(corners, axis=0), np.max(corners, axis=0))
    columns, rows = (max(1, math.ceil(n)) for n in (high - low) / resolution - 1e-6)
    if columns * rows > most:
        enough = least_cell(columns * resolution, rows * resolution)
        size = f"{high[0] - low[0]:g} x {high[1] - low[1]:g} m"
        way_out = f"say map_resolution = {enough:g} in [simulation] of the team file, or --map-resolution {enough:g}"
        raise UsageError(f"the map of a world of {size} is too large at {resolution:g} m a cell: {way_out}")
    origin = Pose(Point(float(low[0]), float(low[1]), 0.0))
    return MapMetaData(resolution=resolution, width=columns, height=rows, origin=origin)


def standing_polygons(world: World) -> list[Floats]:
    """The polygons (corners, 2), in `map`, of all models that nothing can push."""
    fixed = (thing for thing in world.obstacles if thing.mass is None)
    return [place_shape(thing.pose, shape) for thing in fixed for shape in thing.shapes]


def place_shape(pose: Pose2, shape: Shape) -> Floats:
    """(corners, 2): a shape's corners in the frame that its owner's `pose` is in."""
    return place_points(pose, np.array(shape.points, float))


def plan_corners(plan: Floorplan) -> Floats:
    """(4, 2): a floor plan's corners in `map`."""
    rows, columns = plan.occupied.shape
    ends = [(u * columns * plan.cell[0], v * rows * plan.cell[1]) for u in (0, 1) for v in (0, 1)]
    return place_points(plan.pose, np.array(ends, float))


def place_points(pose: Pose2, points: Floats) -> Floats:
    """Points (n, 2) in the frame that `pose` is in."""
    cos, sin = np.cos(pose.yaw), np.sin(pose.yaw)
    x, y = points[:, 0], points[:, 1]
    return np.stack((pose.x + cos * x - sin * y, pose.y + sin * x + cos * y), axis=1)


def _find_outside(world: World, pose: Pose2) -> str:
    """A world is open if a robot of its own starts beyond its bounds, or if it has neither a robot nor a bitmap."""
    if not max(abs(pose.x), abs(pose.y)) <= FAR:
        return f"would stand outside of the world, which ends {FAR:g} m from its origin"
    bounds = find_bounds(world)
    if bounds is None or not (world.robots or world.floorplans):
        return ""
    low, high = bounds
    starts = np.array([robot.pose[:2] for robot in world.robots], float).reshape(-1, 2)
    if ((starts < low) | (starts > high)).any() or bool(((low <= pose[:2]) & (pose[:2] <= high)).all()):
        return ""
    ends = f"from x {low[0]:g}, y {low[1]:g} to x {high[0]:g}, y {high[1]:g}"
    return f"would stand outside of the world, which reaches {ends}"


def _heights_overlap(one: Shape | Floorplan, other: Shape | Floorplan) -> bool:
    return one.z_min < other.z_max and other.z_min < one.z_max


def _meets_plan(plan: Floorplan, polygon: Floats) -> bool:
    """Whether a polygon covers a part of an occupied cell without its rim."""
    local = place_points(plan.pose.inverse(), polygon) / plan.cell
    rows, columns = plan.occupied.shape
    low = np.clip(np.floor(local.min(axis=0)), 0, (columns, rows)).astype(int)
    high = np.clip(np.ceil(local.max(axis=0)), 0, (columns, rows)).astype(int)
    row, column = np.nonzero(plan.occupied[low[1] : high[1], low[0] : high[0]])
    row, column = row + low[1], column + low[0]
    # Of small cells their middles are left.
    rim = min(0.5, WALL_RIM / min(plan.cell))
    return bool(in_polygon(local, column + 0.5, row + 0.5).any()) or any(
        _edge_meets_cells((ax, ay), (bx, by), (column + rim, row + rim), 1.0 - 2.0 * rim)
        for (ax, ay), (bx, by) in zip(local.tolist(), np.roll(local, 1, axis=0).tolist(), strict=True)
    )


def _edge_meets_cells(a: Point2, b: Point2, lows: tuple[Floats, Floats], side: float) -> bool:
    """Whether a line passes through the inside of any square at `lows` (Liang and Barsky's clipping)."""
    first, last = np.zeros(len(lows[0])), np.ones(len(lows[0]))
    for start, end, low in zip(a, b, lows, strict=True):
        way = end - start
        if way == 0.0:
            last[(start <= low) | (start >= low + side)] = -1.0
            continue
        t, u = (low - start) / way, (low + side - start) / way
        first, last = np.maximum(first, np.minimum(t, u)), np.minimum(last, np.maximum(t, u))
    return bool((first < last).any())


def _reach(shapes: Sequence[Shape]) -> float:
    """Metres from their owner's origin to their furthest corner."""
    return max((math.hypot(x, y) for shape in shapes for x, y in shape.points), default=0.0)


def _overlap(thing: Floats, body: Floats) -> bool:
    """Whether two simple polygons, convex or not, share more than their edges."""
    body = body + _TOUCH * (body.mean(axis=0) - body)
    if (thing.max(axis=0) <= body.min(axis=0)).any() or (body.max(axis=0) <= thing.min(axis=0)).any():
        return False
    a, b = thing[:, None], np.roll(thing, 1, axis=0)[:, None]
    c, d = body[None], np.roll(body, 1, axis=0)[None]
    cross = (_side(a, b, c) * _side(a, b, d) < 0.0) & (_side(c, d, a) * _side(c, d, b) < 0.0)
    # If no edges cross, the polygons are apart, or one holds the other.
    return bool(cross.any() or in_polygon(thing, *body[0]) or in_polygon(body, *thing[0]))


def _side(a: Floats, b: Floats, p: Floats) -> Floats:
    """Above 0 where `p` lies left of the line from `a` to `b`."""
    side: Floats = (b[..., 0] - a[..., 0]) * (p[..., 1] - a[..., 1]) - (b[..., 1] - a[..., 1]) * (p[..., 0] - a[..., 0])
    return side
