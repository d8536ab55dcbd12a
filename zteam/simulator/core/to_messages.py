"""Observations as ROS messages, and the robots' transforms. `SENSORS` has a row for each kind of sensor."""

import numpy as np

from zteam import names
from zteam.geometry import Pose2, normalize_angle, quaternion_from_yaw
from zteam.messages import (
    Blobs,
    Bool,
    Bumper,
    Fiducials,
    Header,
    JointState,
    LaserScan,
    Odometry,
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
from zteam.messages.planar import pose_message
from zteam.simulator.core.devices import Sensor, prepare_blobfinders, prepare_bumpers, prepare_fiducials
from zteam.simulator.core.observation import Observation, RobotObservation
from zteam.simulator.world.devices import KINDS, DeviceKind
from zteam.simulator.world.model import Robot

_INFRARED = 1


def _place(robot: Robot, lasers: bool, index: int) -> int:
    """Place among a robot's rangers of its `index`-th laser, or else of its `index`-th sonar."""
    return [place for place, ranger in enumerate(robot.rangers) if ranger.is_laser == lasers][index]


def scan_message(observation: Observation, robot_id: int, index: int) -> LaserScan:
    """The scan of the robot's `index`-th laser, in `robot_N/base_laser_link[_i]`; no hit is `range_max`."""
    robot = observation.robots[robot_id]
    carrier = robot.robot
    place = _place(carrier, True, index) if len(carrier.rangers) > 1 else 0
    ranger, (ranges, intensities) = carrier.rangers[place], robot.reading(place)
    half = ranger.fov / 2
    step, low, high = ranger.angle_increment, ranger.range_min, ranger.range_max
    # By place: keywords take time.
    return LaserScan(
        header(observation, KINDS[names.BASE_SCAN], robot_id, index),
        -half, half, step, 0.0, 0.0, low, high, ranges, intensities,
    )  # fmt: skip


def range_message(observation: Observation, robot_id: int, index: int) -> Range:
    """The reading of the robot's `index`-th one-ray sensor, in `robot_N/sonar_i`."""
    robot = observation.robots[robot_id]
    place = _place(robot.robot, False, index)
    ranger = robot.robot.rangers[place]
    return Range(
        header=header(observation, KINDS[names.SONAR], robot_id, index),
        radiation_type=_INFRARED,
        field_of_view=ranger.fov,
        min_range=ranger.range_min,
        max_range=ranger.range_max,
        range=float(robot.reading(place).ranges[0]),
    )


def odometry_message(observation: Observation, robot_id: int, index: int = 0) -> Odometry:
    """Odometry since the start, in `robot_N/odom`."""
    robot = observation.robots[robot_id]
    frame = names.robot_frame(robot_id, names.ODOM)
    return _odometry(observation.stamp, frame, robot_id, robot.odom, robot)


def ground_truth_message(observation: Observation, robot_id: int, index: int = 0) -> Odometry:
    """The true pose in `map`; the twist is in the robot's own frame, as a nav_msgs/Odometry's is."""
    robot = observation.robots[robot_id]
    return _odometry(observation.stamp, names.MAP_FRAME, robot_id, robot.truth, robot)


def _odometry(stamp: int, frame: str, robot_id: int, pose: Pose2, robot: RobotObservation) -> Odometry:
    vx, vy, w = robot.velocity
    return Odometry(
        Header(time_from_ns(stamp), frame),
        names.robot_frame(robot_id, names.BASE_FOOTPRINT),
        PoseWithCovariance(pose_message(pose)),
        TwistWithCovariance(Twist(Vector3(vx, vy, 0.0), Vector3(0.0, 0.0, w))),
    )


def joint_message(observation: Observation, robot_id: int, index: int = 0) -> JointState:
    """The wheels; joint names are the robot's own, without its prefix."""
    joints = observation.robots[robot_id].joints
    return JointState(
        Header(time_from_ns(observation.stamp), ""), list(joints.names), np.array(joints.positions),
        np.array(joints.velocities),
    )  # fmt: skip


def stall_message(observation: Observation, robot_id: int, index: int = 0) -> Bool:
    """Whether the robot is commanded to move, but blocked."""
    return Bool(observation.robots[robot_id].stall)


def fiducials_message(observation: Observation, robot_id: int, index: int) -> Fiducials:
    """What the robot's `index`-th fiducial finder sees, in `robot_N/fiducial_link[_i]`."""
    seen = observation.robots[robot_id].fiducials[index]
    return Fiducials(header(observation, KINDS[names.FIDUCIALS], robot_id, index), list(seen))


def bumper_message(observation: Observation, robot_id: int, index: int = 0) -> Bumper:
    """All pieces of all of a robot's bumpers."""
    pressed = np.array(observation.robots[robot_id].bumpers, bool)
    return Bumper(header(observation, KINDS[names.BUMPER], robot_id, index), pressed)


def blobs_message(observation: Observation, robot_id: int, index: int) -> Blobs:
    """What the robot's `index`-th blob finder sees, in `robot_N/blobfinder_link[_i]`; an unknown colour is black."""
    seen = observation.robots[robot_id].blobs[index]
    return Blobs(header(observation, KINDS[names.BLOBS], robot_id, index), list(seen))


def header(observation: Observation, kind: DeviceKind, robot_id: int, index: int) -> Header:
    """The observation's stamp and the device's frame."""
    return Header(time_from_ns(observation.stamp), kind.frame(robot_id, index))


SENSORS: dict[str, Sensor] = {
    sensor.kind.topic: sensor
    for sensor in (
        Sensor(KINDS[names.ODOM], odometry_message),
        Sensor(KINDS[names.BASE_SCAN], scan_message),
        Sensor(KINDS[names.GROUND_TRUTH], ground_truth_message),
        Sensor(KINDS[names.STALL], stall_message),
        Sensor(KINDS[names.JOINT_STATES], joint_message),
        Sensor(KINDS[names.SONAR], range_message),
        Sensor(KINDS[names.FIDUCIALS], fiducials_message, prepare_fiducials),
        Sensor(KINDS[names.BUMPER], bumper_message, prepare_bumpers),
        Sensor(KINDS[names.BLOBS], blobs_message, prepare_blobfinders),
    )
}
"""All that is measured of a robot, by topic, in the order in which it is published."""


def transforms(stamp: int, robot_id: int, odom: Pose2) -> TFMessage:
    """odom -> base_footprint at `stamp` (ns)."""
    parent, child = names.robot_frame(robot_id, names.ODOM), names.robot_frame(robot_id, names.BASE_FOOTPRINT)
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
    for kind in KINDS.values():
        for index, device in enumerate(kind.of(robot) if kind.link else ()):
            pose = Pose2(device.x, device.y, device.yaw)
            found.append(_transform(0, base, kind.frame(robot_id, index), pose, device.z))
    return TFMessage(found)


def _transform(stamp: int, parent: str, child: str, pose: Pose2, z: float) -> TransformStamped:
    rotation = Quaternion(*quaternion_from_yaw(normalize_angle(pose.yaw)))
    return TransformStamped(Header(time_from_ns(stamp), parent), child, Transform(Vector3(pose.x, pose.y, z), rotation))
