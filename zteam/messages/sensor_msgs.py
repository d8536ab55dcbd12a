"""Types of sensor_msgs, as in ROS 2 Jazzy."""

import msgspec

from zteam.messages.geometry_msgs import Quaternion, Vector3
from zteam.messages.message import Covariance3, Float32Seq, Float64Seq, Uint8Seq, float32, uint8, zeros
from zteam.messages.std_msgs import Stamped


class LaserScan(Stamped):
    """One sweep of a planar laser: ranges in metres, angles in radians."""

    angle_min: float32 = 0.0
    angle_max: float32 = 0.0
    angle_increment: float32 = 0.0
    time_increment: float32 = 0.0
    scan_time: float32 = 0.0
    range_min: float32 = 0.0
    range_max: float32 = 0.0
    ranges: Float32Seq = zeros("float32")
    intensities: Float32Seq = zeros("float32")


class Range(Stamped):
    """One reading of a one-ray sensor."""

    radiation_type: uint8 = 0
    field_of_view: float32 = 0.0
    min_range: float32 = 0.0
    max_range: float32 = 0.0
    range: float32 = 0.0
    variance: float32 = 0.0


class JointState(Stamped):
    """Angles of joints in radians, their rates in rad/s, and efforts; a sequence may be empty."""

    name: list[str] = msgspec.field(default_factory=list)
    position: Float64Seq = zeros("float64")
    velocity: Float64Seq = zeros("float64")
    effort: Float64Seq = zeros("float64")


class Imu(Stamped):
    """Orientation, turn rates in rad/s, accelerations in m/s^2, each with a 3 by 3 covariance, row by row.

    A covariance that begins with -1 says that the quantity is not measured; zeros say that it is unknown.
    """

    orientation: Quaternion = msgspec.field(default_factory=Quaternion)
    orientation_covariance: Covariance3 = zeros("float64", 9)
    angular_velocity: Vector3 = msgspec.field(default_factory=Vector3)
    angular_velocity_covariance: Covariance3 = zeros("float64", 9)
    linear_acceleration: Vector3 = msgspec.field(default_factory=Vector3)
    linear_acceleration_covariance: Covariance3 = zeros("float64", 9)


class CompressedImage(Stamped):
    """An image file of the named format, such as `png`."""

    format: str = ""
    data: Uint8Seq = zeros("uint8")
