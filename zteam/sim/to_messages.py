"""Observations as ROS messages."""

from collections.abc import Callable, Sequence

import numpy as np

from zteam import names
from zteam.geometry import Pose2, normalize_angle, quaternion_from_yaw
from zteam.messages import (
    Blob,
    Blobs,
    Bumper,
    ColorRGBA,
    Fiducial,
    Fiducials,
    Header,
    JointState,
    LaserScan,
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
from zteam.world.colors import find_color
from zteam.world.model import Blobfinder, Finder, Ranger, Robot

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


def joint_message(observation: Observation, robot_id: int) -> JointState:
    """The wheels; joint names are the robot's own, without its prefix."""
    joints = observation.robots[robot_id].joints
    return JointState(
        Header(time_from_ns(observation.stamp), ""), list(joints.names), np.array(joints.positions),
        np.array(joints.velocities),
    )  # fmt: skip


def fiducials_message(observation: Observation, robot_id: int, index: int) -> Fiducials:
    """What the robot's `index`-th fiducial finder sees, in `robot_N/fiducial_link[_i]`."""
    seen = observation.robots[robot_id].fiducials[index]
    frame = names.robot_frame(robot_id, names.finder_link(index))
    return Fiducials(Header(time_from_ns(observation.stamp), frame), [Fiducial(*sighting) for sighting in seen])


def bumper_message(observation: Observation, robot_id: int) -> Bumper:
    """All pieces of all of a robot's bumpers."""
    frame = names.robot_frame(robot_id, names.BASE_LINK)
    pressed = np.array(observation.robots[robot_id].bumpers, bool)
    return Bumper(Header(time_from_ns(observation.stamp), frame), pressed)


def blobs_message(observation: Observation, robot_id: int, index: int) -> Blobs:
    """What the robot's `index`-th blob finder sees, in `robot_N/blobfinder_link[_i]`; an unknown colour is black."""
    frame = names.robot_frame(robot_id, names.blobfinder_link(index))
    blobs = [
        Blob(ColorRGBA(*(find_color(name) or (0.0, 0.0, 0.0))), name, bearing, width, far)
        for name, bearing, width, far in observation.robots[robot_id].blobs[index]
    ]
    return Blobs(Header(time_from_ns(observation.stamp), frame), blobs)


def transforms(stamp: int, robot_id: int, odom: Pose2) -> TFMessage:
    """odom -> base_footprint at `stamp` (ns)."""
    parent, child = (names.robot_frame(robot_id, f) for f in (names.ODOM, names.BASE_FOOTPRINT))
    return TFMessage([_transform(stamp, parent, child, odom, 0.0)])


def static_transforms(robot_id: int, robot: Robot, odom_origin: Pose2) -> TFMessage:
    """map -> odom (the start pose), base_footprint -> base_link -> every device."""

    def own(local: str) -> str:
        return names.robot_frame(robot_id, local)

    base = own(names.BASE_LINK)
    found = [
        _transform(0, names.MAP_FRAME, own(names.ODOM), odom_origin, 0.0),
        _transform(0, own(names.BASE_FOOTPRINT), base, Pose2(0.0, 0.0, 0.0), 0.0),
    ]
    lasers, sonars = ([robot.rangers[place] for place in _places(robot, kind)] for kind in (True, False))
    kinds: list[tuple[Sequence[Ranger | Finder | Blobfinder], Callable[[int], str]]] = [
        (lasers, names.laser_link),
        (sonars, names.sonar_link),
        (robot.finders, names.finder_link),
        (robot.blobfinders, names.blobfinder_link),
    ]
    for devices, link in kinds:
        for index, device in enumerate(devices):
            pose = Pose2(device.x, device.y, device.yaw)
            found.append(_transform(0, base, own(link(index)), pose, device.z))
    return TFMessage(found)


def _transform(stamp: int, parent: str, child: str, pose: Pose2, z: float) -> TransformStamped:
    rotation = Quaternion(*quaternion_from_yaw(normalize_angle(pose.yaw)))
    return TransformStamped(Header(time_from_ns(stamp), parent), child, Transform(Vector3(pose.x, pose.y, z), rotation))
