"""Observations as ROS messages, and the robots' transforms. `BUILDERS` has a row for each kind of sensor."""

from collections.abc import Callable
from functools import partial

import numpy as np

from zteam import messages, names
from zteam.geometry import Pose2, normalize_angle, quaternion_from_yaw
from zteam.messages.planar import pose_message
from zteam.simulator.core.engine import Observation
from zteam.simulator.world.devices import KINDS, DeviceKind
from zteam.simulator.world.model import Robot


def _place(robot: Robot, lasers: bool, index: int) -> int:
    """Place among a robot's rangers of its `index`-th laser, or else of its `index`-th sonar."""
    return [place for place, ranger in enumerate(robot.rangers) if ranger.is_laser == lasers][index]


def scan_message(observation: Observation, robot_id: int, index: int) -> messages.LaserScan:
    """The scan of the robot's `index`-th laser, in `robot_N/base_laser_link[_i]`; no hit is `range_max`."""
    robot = observation.robots[robot_id]
    carrier = robot.robot
    place = _place(carrier, True, index) if len(carrier.rangers) > 1 else 0
    ranger, (ranges, intensities) = carrier.rangers[place], robot.readings[place]
    half = ranger.fov / 2
    step, low, high = ranger.angle_increment, ranger.range_min, ranger.range_max
    # By place: keywords take time.
    return messages.LaserScan(
        header(observation, KINDS[names.BASE_SCAN], robot_id, index),
        -half, half, step, 0.0, 0.0, low, high, ranges, intensities,
    )  # fmt: skip


def range_message(observation: Observation, robot_id: int, index: int) -> messages.Range:
    """The reading of the robot's `index`-th one-ray sensor, in `robot_N/sonar_i`."""
    robot = observation.robots[robot_id]
    place = _place(robot.robot, False, index)
    ranger = robot.robot.rangers[place]
    # Its radiation type is 1: infrared.
    return messages.Range(
        header(observation, KINDS[names.SONAR], robot_id, index), 1, ranger.fov, ranger.range_min, ranger.range_max,
        float(robot.readings[place].ranges[0]),
    )  # fmt: skip


def odometry_message(observation: Observation, robot_id: int, index: int = 0) -> messages.Odometry:
    """Odometry since the start, in `robot_N/odom`."""
    return _odometry(observation, robot_id, names.robot_frame(robot_id, names.ODOM), observation.robots[robot_id].odom)


def _odometry(observation: Observation, robot_id: int, frame: str, pose: Pose2) -> messages.Odometry:
    vx, vy, w = observation.robots[robot_id].velocity
    return messages.Odometry(
        messages.Header(observation.time, frame),
        names.robot_frame(robot_id, names.BASE_FOOTPRINT),
        messages.PoseWithCovariance(pose_message(pose)),
        messages.TwistWithCovariance(messages.Twist(messages.Vector3(vx, vy, 0.0), messages.Vector3(0.0, 0.0, w))),
    )


def joint_message(observation: Observation, robot_id: int, index: int = 0) -> messages.JointState:
    """The wheels; joint names are the robot's own, without its prefix."""
    joints = observation.robots[robot_id].joints
    return messages.JointState(
        messages.Header(observation.time, ""), list(joints.names), np.array(joints.positions),
        np.array(joints.velocities),
    )  # fmt: skip


def detections_message(topic: str, observation: Observation, robot_id: int, index: int) -> messages.Message:
    """What the robot's `index`-th finder of fiducials or blobs sees, in its own frame; an unknown colour is black."""
    kind, seen = KINDS[topic], observation.robots[robot_id].detections[topic][index]
    return kind.message(header(observation, kind, robot_id, index), list(seen))


def bumper_message(observation: Observation, robot_id: int, index: int = 0) -> messages.Bumper:
    """All pieces of all of a robot's bumpers."""
    pressed = np.array(observation.robots[robot_id].bumpers, bool)
    return messages.Bumper(header(observation, KINDS[names.BUMPER], robot_id, index), pressed)


def header(observation: Observation, kind: DeviceKind, robot_id: int, index: int) -> messages.Header:
    """The observation's stamp and the device's frame."""
    return messages.Header(observation.time, kind.frame(robot_id, index))


BUILDERS: dict[str, Callable[[Observation, int, int], messages.Message]] = {
    names.ODOM: odometry_message,
    names.BASE_SCAN: scan_message,
    # The twist is in the robot's own frame, as a nav_msgs/Odometry's is.
    names.GROUND_TRUTH: lambda seen, i, _: _odometry(seen, i, names.MAP_FRAME, seen.robots[i].truth),
    names.STALL: lambda seen, i, _: messages.Bool(seen.robots[i].stall),
    names.JOINT_STATES: joint_message,
    names.SONAR: range_message,
    names.FIDUCIALS: partial(detections_message, names.FIDUCIALS),
    names.BUMPER: bumper_message,
    names.BLOBS: partial(detections_message, names.BLOBS),
}
"""What builds the message of a robot (by id) of a number, of one tick: by the topic of what is measured."""


def transforms(time: messages.Time, robot_id: int, odom: Pose2) -> messages.TFMessage:
    """odom -> base_footprint at `time`."""
    parent, child = names.robot_frame(robot_id, names.ODOM), names.robot_frame(robot_id, names.BASE_FOOTPRINT)
    return messages.TFMessage([_transform(time, parent, child, odom, 0.0)])


def static_transforms(robot_id: int, robot: Robot, odom_origin: Pose2) -> messages.TFMessage:
    """map -> odom (the start pose), base_footprint -> base_link -> every device."""
    own_frames, same = (names.ODOM, names.BASE_FOOTPRINT, names.BASE_LINK), Pose2(0.0, 0.0, 0.0)
    odom, footprint, base = (names.robot_frame(robot_id, own) for own in own_frames)
    at_all, origin = messages.Time(), odom_origin._replace(yaw=normalize_angle(odom_origin.yaw))
    found = [_transform(at_all, names.MAP_FRAME, odom, origin, 0.0), _transform(at_all, footprint, base, same, 0.0)]
    for kind in KINDS.values():
        for index, device in enumerate(kind.of(robot) if kind.link else ()):
            pose = Pose2(device.x, device.y, normalize_angle(device.yaw))
            found.append(_transform(at_all, base, kind.frame(robot_id, index), pose, device.z))
    return messages.TFMessage(found)


def _transform(time: messages.Time, parent: str, child: str, pose: Pose2, z: float) -> messages.TransformStamped:
    rotation = messages.Quaternion(*quaternion_from_yaw(pose.yaw))
    placed = messages.Transform(messages.Vector3(pose.x, pose.y, z), rotation)
    return messages.TransformStamped(messages.Header(time, parent), child, placed)
