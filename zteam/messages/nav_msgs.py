"""Types of nav_msgs, as in ROS 2 Jazzy."""

import msgspec

from zteam.messages.geometry_msgs import Pose, PoseStamped, PoseWithCovariance, TwistWithCovariance
from zteam.messages.message import Int8Seq, Message, float32, uint32, zeros
from zteam.messages.std_msgs import Stamped, Time


class Odometry(Stamped):
    """Pose of `child_frame_id` in `header.frame_id` and velocity in `child_frame_id`."""

    child_frame_id: str = ""
    pose: PoseWithCovariance = msgspec.field(default_factory=PoseWithCovariance)
    twist: TwistWithCovariance = msgspec.field(default_factory=TwistWithCovariance)


class MapMetaData(Message):
    """Size of a map in cells, metres a cell, and the pose of cell (0, 0)."""

    map_load_time: Time = msgspec.field(default_factory=Time)
    resolution: float32 = 0.0
    width: uint32 = 0
    height: uint32 = 0
    origin: Pose = msgspec.field(default_factory=Pose)


class OccupancyGrid(Stamped):
    """A map, row by row from the origin: 0 free, 100 occupied, -1 unknown."""

    info: MapMetaData = msgspec.field(default_factory=MapMetaData)
    data: Int8Seq = zeros("int8")


class Path(Stamped):
    """Poses to pass, from the first to the last."""

    poses: list[PoseStamped] = msgspec.field(default_factory=list)
