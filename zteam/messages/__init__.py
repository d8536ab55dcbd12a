"""Messages under their ROS 2 names, their CDR bytes, and their JSON."""

from zteam.messages.types import (
    Bool,
    Clock,
    Done,
    Header,
    LaserScan,
    MapMetaData,
    Message,
    OccupancyGrid,
    Odometry,
    Point,
    Pose,
    PoseStamped,
    PoseWithCovariance,
    Quaternion,
    Range,
    RobotState,
    RobotStatus,
    String,
    TeamState,
    TeamStatus,
    TFMessage,
    Tick,
    Time,
    Transform,
    TransformStamped,
    Twist,
    TwistWithCovariance,
    Vector3,
)

__all__ = [
    "Bool", "Clock", "Done", "Header", "LaserScan", "MapMetaData", "Message", "OccupancyGrid", "Odometry", "Point",
    "Pose", "PoseStamped", "PoseWithCovariance", "Quaternion", "Range", "RobotState", "RobotStatus", "String",
    "TFMessage", "TeamState", "TeamStatus", "Tick", "Time", "Transform", "TransformStamped", "Twist",
    "TwistWithCovariance", "Vector3",
]  # fmt: skip
