"""Messages under their ROS 2 names, their CDR bytes, and their JSON."""

from zteam.messages.cdr import decode, encode
from zteam.messages.geometry_msgs import *
from zteam.messages.jsonform import from_text, to_json, to_plain
from zteam.messages.message import *
from zteam.messages.nav_msgs import *
from zteam.messages.sensor_msgs import *
from zteam.messages.std_msgs import *
from zteam.messages.visualization_msgs import *
from zteam.messages.zteam_msgs import *

__all__ = [
    "BaseInfo", "Blob", "Blobs", "Bool", "BoolSeq", "Bumper", "Clock", "ColorRGBA", "CompressedImage", "Covariance",
    "Covariance3", "Done", "Duration", "Fiducial", "Fiducials", "Float32", "Float32Seq", "Float64", "Float64Seq",
    "Header", "Imu", "Input",
    "Int8Seq", "Int32", "Int32Seq", "JointState", "LaserScan", "Log", "LogLevel", "MapMetaData",
    "Marker", "MarkerAction", "MarkerArray", "MarkerType", "MeshFile", "Message", "NavigationState", "NavigationStatus",
    "OccupancyGrid", "Odometry", "Path", "Point", "Point32", "PointStamped", "Polygon", "PolygonStamped", "Pose",
    "PoseArray", "PoseStamped", "PoseWithCovariance", "PoseWithCovarianceStamped", "Quaternion", "Range", "RobotDriver",
    "RobotState", "RobotStatus", "String", "TFMessage", "TeamState", "TeamStatus", "Tick", "Time", "Transform",
    "TransformStamped", "Twist", "TwistStamped", "TwistWithCovariance", "UVCoordinate", "Uint8Seq", "Vector3",
    "Vector3Stamped", "all_types", "bool_", "decode", "encode", "encoding_of", "float32", "float64", "from_text",
    "int8", "int32", "message_type", "ns_from_time", "time_from_ns", "to_json", "to_plain", "type_of_encoding", "uint8",
    "uint32", "uint64",
]  # fmt: skip
