"""Observations as ROS messages."""

import math

import numpy as np

from zteam import names
from zteam.geometry import Pose2, normalize_angle, quaternion_from_yaw
from zteam.messages import (
    Header,
    LaserScan,
    MapMetaData,
    OccupancyGrid,
    Odometry,
    Point,
    Pose,
    PoseWithCovariance,
    Quaternion,
    Range,
    TFMessage,
    Transform,
    TransformStamped,
    Twist,
    TwistWithCovariance,
    Vector3,
    time_from_ns,
)
from zteam.sim.observation import Observation, RobotObservation
from zteam.world.model import Ranger, Robot, Shape, World

_INFRARED = 1


def is_laser(ranger: Ranger) -> bool:
    """Rangers with more than one ray are lasers (LaserScan), the others sonars (Range)."""
    return ranger.samples > 1


def _places(robot: Robot, lasers: bool) -> list[int]:
    return [i for i, ranger in enumerate(robot.rangers) if is_laser(ranger) == lasers]


def scan_message(observation: Observation, robot_id: int, index: int) -> LaserScan:
    """The scan of the robot's `index`-th laser, in `robot_N/base_laser_link[_i]`; no hit is `range_max`."""
    robot = observation.robots[robot_id]
    place = _places(robot.robot, True)[index]
    ranger, reading = robot.robot.rangers[place], robot.readings[place]
    return LaserScan(
        header=Header(time_from_ns(observation.stamp), names.robot_frame(robot_id, names.laser_link(index))),
        angle_min=-ranger.fov / 2,
        angle_max=ranger.fov / 2,
        angle_increment=ranger.angle_increment,
        range_min=ranger.range_min,
        range_max=ranger.range_max,
        ranges=reading.ranges,
        intensities=reading.intensities,
    )


def range_message(observation: Observation, robot_id: int, index: int) -> Range:
    """The reading of the robot's `index`-th one-ray sensor, in `robot_N/sonar_i`."""
    robot = observation.robots[robot_id]
    place = _places(robot.robot, False)[index]
    ranger = robot.robot.rangers[place]
    return Range(
        header=Header(time_from_ns(observation.stamp), names.robot_frame(robot_id, names.sonar_link(index))),
        radiation_type=_INFRARED,
        field_of_view=ranger.fov,
        min_range=ranger.range_min,
        max_range=ranger.range_max,
        range=float(robot.readings[place].ranges[0]),
    )


def odometry_message(observation: Observation, robot_id: int) -> Odometry:
    """Odometry since the start, in `robot_N/odom`."""
    robot = observation.robots[robot_id]
    frame = names.robot_frame(robot_id, names.ODOM)
    return _odometry(observation.stamp, frame, robot_id, robot.odom, robot)


def ground_truth_message(observation: Observation, robot_id: int) -> Odometry:
    """The true pose in `map`; the twist is in the robot's own frame, as a nav_msgs/Odometry's is."""
    robot = observation.robots[robot_id]
    return _odometry(observation.stamp, names.MAP_FRAME, robot_id, robot.truth, robot)


def _odometry(stamp: int, frame: str, robot_id: int, pose: Pose2, robot: RobotObservation) -> Odometry:
    vx, vy, w = robot.velocity
    return Odometry(
        Header(time_from_ns(stamp), frame),
        names.robot_frame(robot_id, names.BASE_FOOTPRINT),
        PoseWithCovariance(Pose(Point(pose.x, pose.y, 0.0), Quaternion(*quaternion_from_yaw(pose.yaw)))),
        TwistWithCovariance(Twist(Vector3(vx, vy, 0.0), Vector3(0.0, 0.0, w))),
    )


def transforms(stamp: int, robot_id: int, odom: Pose2) -> TFMessage:
    """odom -> base_footprint at `stamp` (ns)."""
    parent, child = (names.robot_frame(robot_id, f) for f in (names.ODOM, names.BASE_FOOTPRINT))
    return TFMessage([_transform(stamp, parent, child, odom, 0.0)])


def static_transforms(robot_id: int, robot: Robot) -> TFMessage:
    """map -> odom (the start pose), base_footprint -> base_link -> every laser and sonar."""

    def own(local: str) -> str:
        return names.robot_frame(robot_id, local)

    base = own(names.BASE_LINK)
    found = [
        _transform(0, names.MAP_FRAME, own(names.ODOM), robot.pose, 0.0),
        _transform(0, own(names.BASE_FOOTPRINT), base, Pose2(0.0, 0.0, 0.0), 0.0),
    ]
    for lasers in (True, False):
        for index, place in enumerate(_places(robot, lasers)):
            ranger = robot.rangers[place]
            link = names.laser_link(index) if lasers else names.sonar_link(index)
            pose = Pose2(ranger.x, ranger.y, ranger.yaw)
            found.append(_transform(0, base, own(link), pose, ranger.z))
    return TFMessage(found)


def _transform(stamp: int, parent: str, child: str, pose: Pose2, z: float) -> TransformStamped:
    rotation = Quaternion(*quaternion_from_yaw(normalize_angle(pose.yaw)))
    return TransformStamped(Header(time_from_ns(stamp), parent), child, Transform(Vector3(pose.x, pose.y, z), rotation))


def map_message(world: World, resolution: float) -> OccupancyGrid:
    """Everything that stands still, on one axis-aligned grid of square cells of `resolution` metres.

    A cell is 100 where its centre lies in an occupied cell of a bitmap or in an obstacle's outline, else 0.
    """
    corners = [corner for plan in world.floorplans for corner in _plan_corners(plan.pose, plan.occupied, plan.cell)]
    outlines = [(shape, _polygon(obstacle.pose, shape)) for obstacle in world.obstacles for shape in obstacle.shapes]
    corners += [(float(px), float(py)) for _, polygon in outlines for px, py in polygon]
    corners += [robot.pose[:2] for robot in world.robots] if not corners else []
    low, high = np.min(corners, axis=0), np.max(corners, axis=0)
    columns, rows = (max(1, math.ceil(n)) for n in (high - low) / resolution - 1e-9)
    x = low[0] + (np.arange(columns) + 0.5) * resolution
    y = low[1] + (np.arange(rows) + 0.5) * resolution
    grid = np.zeros((rows, columns), np.int8)
    for plan in world.floorplans:
        _draw_plan(grid, x, y, plan.pose, plan.occupied, plan.cell)
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
