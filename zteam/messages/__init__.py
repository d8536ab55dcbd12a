"""Messages under their ROS 2 names, their CDR bytes, and their JSON."""

from zteam.messages.cdr import decode, encode
from zteam.messages.jsonform import from_text, to_json, to_plain
from zteam.messages.registry import (
    all_types,
    encoding_of,
    message_type,
    ns_from_time,
    time_from_ns,
    type_of_encoding,
)
from zteam.messages.types import (
    Blob,
    Blobs,
    Bool,
    Bumper,
    Clock,
    ColorRGBA,
    Done,
    Fiducial,
    Fiducials,
    Header,
    JointState,
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
    "Blob", "Blobs", "Bool", "Bumper", "Clock", "ColorRGBA", "Done", "Fiducial", "Fiducials", "Header", "JointState",
    "LaserScan", "MapMetaData", "Message", "OccupancyGrid", "Odometry", "Point",
    "Pose", "PoseStamped", "PoseWithCovariance", "Quaternion", "Range", "RobotState", "RobotStatus", "String",
    "TFMessage", "TeamState", "TeamStatus", "Tick", "Time", "Transform", "TransformStamped", "Twist",
    "TwistWithCovariance", "Vector3", "all_types", "decode", "encode", "encoding_of", "from_text", "message_type",
    "ns_from_time", "time_from_ns", "to_json", "to_plain", "type_of_encoding",
]  # fmt: skip
