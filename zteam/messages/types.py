"""Message types under their ROS 2 names, with ROS 2's fields in ROS 2's order, and zteam's own `zteam_msgs`.

Sources: geometry_msgs, nav_msgs, sensor_msgs, std_msgs, tf2_msgs, rosgraph_msgs and builtin_interfaces of ROS 2
Jazzy; `zteam_msgs` is zteam's own (docs/time.md, docs/api.md). Annotations such as `float32` say how a field stands on
the wire. The file is long because it is a list, in which a type stands below the types that it contains.
"""

from typing import Annotated, Any, ClassVar

import msgspec
import numpy as np
from numpy.typing import NDArray

from zteam.errors import UsageError

bool_ = Annotated[bool, "bool"]
int8 = Annotated[int, "int8"]
uint8 = Annotated[int, "uint8"]
int32 = Annotated[int, "int32"]
uint32 = Annotated[int, "uint32"]
uint64 = Annotated[int, "uint64"]
float32 = Annotated[float, "float32"]
float64 = Annotated[float, "float64"]
Int8Seq = Annotated[NDArray[np.int8], "int8[]"]
Int32Seq = Annotated[NDArray[np.int32], "int32[]"]
BoolSeq = Annotated[NDArray[np.bool_], "bool[]"]
Float64Seq = Annotated[NDArray[np.float64], "float64[]"]
Float32Seq = Annotated[NDArray[np.float32], "float32[]"]
Covariance = Annotated[NDArray[np.float64], "float64[36]"]


def _frozen(array: NDArray[Any]) -> NDArray[Any]:
    # Messages share their defaults, so no message may write into them.
    array.flags.writeable = False
    return array


_NO_INT8: NDArray[np.int8] = _frozen(np.zeros(0, np.int8))
_NO_INT32: NDArray[np.int32] = _frozen(np.zeros(0, np.int32))
_NO_FLOAT32: NDArray[np.float32] = _frozen(np.zeros(0, np.float32))
_NO_FLOAT64: NDArray[np.float64] = _frozen(np.zeros(0, np.float64))
_NO_BOOL: NDArray[np.bool_] = _frozen(np.zeros(0, np.bool_))
_NO_COVARIANCE: NDArray[np.float64] = _frozen(np.zeros(36, np.float64))


REGISTERED: dict[str, type["Message"]] = {}
"""Every message type that is imported, by its full ROS name."""


class Message(msgspec.Struct, eq=False, gc=False):
    """Base of all messages. `ros_type` is the type's full ROS name, such as `geometry_msgs/msg/Twist`.

    A subclass of your own gives a `ros_type` and fields annotated with a message type, `str`, `list[...]` of these, or
    one of `bool_`, `int8`, `float64`, `Float32Seq`, … of this module; every field has a default. Raises UsageError
    where `ros_type` is no ROS name or is a type of zteam's own.

    The garbage collector leaves messages alone: their types admit no cycles, and a team makes a great many of them.
    """

    ros_type: ClassVar[str] = ""

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        # Only the name: the class has no fields yet. Its codec is generated at its first use.
        if "ros_type" in vars(cls):
            _register(cls)

    def __eq__(self, other: object) -> bool:
        if type(self) is not type(other):
            return NotImplemented
        return all(_same(getattr(self, f), getattr(other, f)) for f in self.__struct_fields__)

    def __ne__(self, other: object) -> bool:
        # Struct has an identity-based one of its own, which would be found before the negation of __eq__.
        return not self == other

    __hash__ = None  # type: ignore[assignment]


def _register(kind: type[Message]) -> None:
    name = kind.ros_type
    parts = name.split("/")
    if len(parts) != 3 or parts[1] != "msg" or not all(part.isidentifier() for part in parts):
        raise UsageError(f"{kind.__name__}: ros_type is {name!r}; write it as 'my_msgs/msg/{kind.__name__}'")
    known = REGISTERED.get(name)
    if known is not None and known.__module__ == __name__:
        raise UsageError(f"{kind.__name__}: {name} is a type of zteam's own; choose another package name")
    # A class that is defined anew, as in a notebook, replaces the one before.
    REGISTERED[name] = kind


def _same(a: Any, b: Any) -> bool:
    return bool(np.array_equal(a, b, equal_nan=True)) if isinstance(a, np.ndarray) else bool(a == b)


class Time(Message):
    """A point in time."""

    ros_type: ClassVar[str] = "builtin_interfaces/msg/Time"
    sec: int32 = 0
    nanosec: uint32 = 0


class Header(Message):
    """When and in which frame a message holds."""

    ros_type: ClassVar[str] = "std_msgs/msg/Header"
    stamp: Time = msgspec.field(default_factory=Time)
    frame_id: str = ""


class Bool(Message):
    """A truth value."""

    ros_type: ClassVar[str] = "std_msgs/msg/Bool"
    data: bool_ = False


class Int32(Message):
    """A whole number."""

    ros_type: ClassVar[str] = "std_msgs/msg/Int32"
    data: int32 = 0


class Float32(Message):
    """A number."""

    ros_type: ClassVar[str] = "std_msgs/msg/Float32"
    data: float32 = 0.0


class Float64(Message):
    """A number."""

    ros_type: ClassVar[str] = "std_msgs/msg/Float64"
    data: float64 = 0.0


class String(Message):
    """A text."""

    ros_type: ClassVar[str] = "std_msgs/msg/String"
    data: str = ""


class Clock(Message):
    """Simulated time."""

    ros_type: ClassVar[str] = "rosgraph_msgs/msg/Clock"
    clock: Time = msgspec.field(default_factory=Time)


class ColorRGBA(Message):
    """A colour; channels 0 to 1."""

    ros_type: ClassVar[str] = "std_msgs/msg/ColorRGBA"
    r: float32 = 0.0
    g: float32 = 0.0
    b: float32 = 0.0
    a: float32 = 1.0


class Vector3(Message):
    """A free vector."""

    ros_type: ClassVar[str] = "geometry_msgs/msg/Vector3"
    x: float64 = 0.0
    y: float64 = 0.0
    z: float64 = 0.0


class Point(Message):
    """A position in metres."""

    ros_type: ClassVar[str] = "geometry_msgs/msg/Point"
    x: float64 = 0.0
    y: float64 = 0.0
    z: float64 = 0.0


class Quaternion(Message):
    """An orientation; identity by default."""

    ros_type: ClassVar[str] = "geometry_msgs/msg/Quaternion"
    x: float64 = 0.0
    y: float64 = 0.0
    z: float64 = 0.0
    w: float64 = 1.0


class Pose(Message):
    """Position and orientation."""

    ros_type: ClassVar[str] = "geometry_msgs/msg/Pose"
    position: Point = msgspec.field(default_factory=Point)
    orientation: Quaternion = msgspec.field(default_factory=Quaternion)


class PoseWithCovariance(Message):
    """A pose and its 6 by 6 covariance, row by row (x, y, z, roll, pitch, yaw)."""

    ros_type: ClassVar[str] = "geometry_msgs/msg/PoseWithCovariance"
    pose: Pose = msgspec.field(default_factory=Pose)
    covariance: Covariance = msgspec.field(default_factory=lambda: _NO_COVARIANCE)


class PoseStamped(Message):
    """A pose in a frame at a time."""

    ros_type: ClassVar[str] = "geometry_msgs/msg/PoseStamped"
    header: Header = msgspec.field(default_factory=Header)
    pose: Pose = msgspec.field(default_factory=Pose)


class PointStamped(Message):
    """A point in a frame at a time."""

    ros_type: ClassVar[str] = "geometry_msgs/msg/PointStamped"
    header: Header = msgspec.field(default_factory=Header)
    point: Point = msgspec.field(default_factory=Point)


class Vector3Stamped(Message):
    """A direction or a difference in a frame at a time: turned by transforms, not moved."""

    ros_type: ClassVar[str] = "geometry_msgs/msg/Vector3Stamped"
    header: Header = msgspec.field(default_factory=Header)
    vector: Vector3 = msgspec.field(default_factory=Vector3)


class Twist(Message):
    """Velocity: linear in m/s, angular in rad/s."""

    ros_type: ClassVar[str] = "geometry_msgs/msg/Twist"
    linear: Vector3 = msgspec.field(default_factory=Vector3)
    angular: Vector3 = msgspec.field(default_factory=Vector3)


class TwistWithCovariance(Message):
    """A velocity and its 6 by 6 covariance, row by row."""

    ros_type: ClassVar[str] = "geometry_msgs/msg/TwistWithCovariance"
    twist: Twist = msgspec.field(default_factory=Twist)
    covariance: Covariance = msgspec.field(default_factory=lambda: _NO_COVARIANCE)


class Transform(Message):
    """A rigid transform."""

    ros_type: ClassVar[str] = "geometry_msgs/msg/Transform"
    translation: Vector3 = msgspec.field(default_factory=Vector3)
    rotation: Quaternion = msgspec.field(default_factory=Quaternion)


class TransformStamped(Message):
    """The pose of `child_frame_id` in `header.frame_id` at `header.stamp`."""

    ros_type: ClassVar[str] = "geometry_msgs/msg/TransformStamped"
    header: Header = msgspec.field(default_factory=Header)
    child_frame_id: str = ""
    transform: Transform = msgspec.field(default_factory=Transform)


class TFMessage(Message):
    """Transforms that were sent together."""

    ros_type: ClassVar[str] = "tf2_msgs/msg/TFMessage"
    transforms: list[TransformStamped] = msgspec.field(default_factory=list)


class Odometry(Message):
    """Pose of `child_frame_id` in `header.frame_id` and velocity in `child_frame_id`."""

    ros_type: ClassVar[str] = "nav_msgs/msg/Odometry"
    header: Header = msgspec.field(default_factory=Header)
    child_frame_id: str = ""
    pose: PoseWithCovariance = msgspec.field(default_factory=PoseWithCovariance)
    twist: TwistWithCovariance = msgspec.field(default_factory=TwistWithCovariance)


class MapMetaData(Message):
    """Size of a map in cells, metres a cell, and the pose of cell (0, 0)."""

    ros_type: ClassVar[str] = "nav_msgs/msg/MapMetaData"
    map_load_time: Time = msgspec.field(default_factory=Time)
    resolution: float32 = 0.0
    width: uint32 = 0
    height: uint32 = 0
    origin: Pose = msgspec.field(default_factory=Pose)


class OccupancyGrid(Message):
    """A map, row by row from the origin: 0 free, 100 occupied, -1 unknown."""

    ros_type: ClassVar[str] = "nav_msgs/msg/OccupancyGrid"
    header: Header = msgspec.field(default_factory=Header)
    info: MapMetaData = msgspec.field(default_factory=MapMetaData)
    data: Int8Seq = msgspec.field(default_factory=lambda: _NO_INT8)


class LaserScan(Message):
    """One sweep of a planar laser: ranges in metres, angles in radians."""

    ros_type: ClassVar[str] = "sensor_msgs/msg/LaserScan"
    header: Header = msgspec.field(default_factory=Header)
    angle_min: float32 = 0.0
    angle_max: float32 = 0.0
    angle_increment: float32 = 0.0
    time_increment: float32 = 0.0
    scan_time: float32 = 0.0
    range_min: float32 = 0.0
    range_max: float32 = 0.0
    ranges: Float32Seq = msgspec.field(default_factory=lambda: _NO_FLOAT32)
    intensities: Float32Seq = msgspec.field(default_factory=lambda: _NO_FLOAT32)


class Range(Message):
    """One reading of a one-ray sensor."""

    ros_type: ClassVar[str] = "sensor_msgs/msg/Range"
    header: Header = msgspec.field(default_factory=Header)
    radiation_type: uint8 = 0
    field_of_view: float32 = 0.0
    min_range: float32 = 0.0
    max_range: float32 = 0.0
    range: float32 = 0.0
    variance: float32 = 0.0


class JointState(Message):
    """Angles of joints in radians, their rates in rad/s, and efforts; a sequence may be empty."""

    ros_type: ClassVar[str] = "sensor_msgs/msg/JointState"
    header: Header = msgspec.field(default_factory=Header)
    name: list[str] = msgspec.field(default_factory=list)
    position: Float64Seq = msgspec.field(default_factory=lambda: _NO_FLOAT64)
    velocity: Float64Seq = msgspec.field(default_factory=lambda: _NO_FLOAT64)
    effort: Float64Seq = msgspec.field(default_factory=lambda: _NO_FLOAT64)


class Fiducial(Message):
    """A marked model in sight: metres and radians in the frame of the finder; id 0 is too far to be read."""

    ros_type: ClassVar[str] = "zteam_msgs/msg/Fiducial"
    id: int32 = 0
    range: float32 = 0.0
    bearing: float32 = 0.0
    orientation: float32 = 0.0


class Fiducials(Message):
    """All that a fiducial finder sees."""

    ros_type: ClassVar[str] = "zteam_msgs/msg/Fiducials"
    header: Header = msgspec.field(default_factory=Header)
    fiducials: list[Fiducial] = msgspec.field(default_factory=list)


class Bumper(Message):
    """Which pieces of a robot's bumpers are pressed, in file order."""

    ros_type: ClassVar[str] = "zteam_msgs/msg/Bumper"
    header: Header = msgspec.field(default_factory=Header)
    pressed: BoolSeq = msgspec.field(default_factory=lambda: _NO_BOOL)


class Blob(Message):
    """Neighbouring pixels of one colour: middle and width in radians, range of the nearest in metres."""

    ros_type: ClassVar[str] = "zteam_msgs/msg/Blob"
    color: ColorRGBA = msgspec.field(default_factory=ColorRGBA)
    name: str = ""
    bearing: float32 = 0.0
    width: float32 = 0.0
    range: float32 = 0.0


class Blobs(Message):
    """All that a blob finder sees, from right to left."""

    ros_type: ClassVar[str] = "zteam_msgs/msg/Blobs"
    header: Header = msgspec.field(default_factory=Header)
    blobs: list[Blob] = msgspec.field(default_factory=list)


class RobotStatus(Message):
    """What one robot says of itself; `state` is one of RobotState."""

    ros_type: ClassVar[str] = "zteam_msgs/msg/RobotStatus"
    header: Header = msgspec.field(default_factory=Header)
    robot_id: int32 = 0
    is_ready: bool_ = False
    state: uint8 = 0
    epoch: uint32 = 0
    text: str = ""


class TeamStatus(Message):
    """What the monitor says of the team; `state` is one of TeamState, GO holds from `go_stamp` on."""

    ros_type: ClassVar[str] = "zteam_msgs/msg/TeamStatus"
    header: Header = msgspec.field(default_factory=Header)
    state: uint8 = 0
    epoch: uint32 = 0
    go_stamp: Time = msgspec.field(default_factory=Time)
    team_size: int32 = 0
    ready: Int32Seq = msgspec.field(default_factory=lambda: _NO_INT32)
    missing: Int32Seq = msgspec.field(default_factory=lambda: _NO_INT32)
    lost: Int32Seq = msgspec.field(default_factory=lambda: _NO_INT32)


class Tick(Message):
    """Lock-step: the world stands at tick `tick`, with these robots and participants."""

    ros_type: ClassVar[str] = "zteam_msgs/msg/Tick"
    stamp: Time = msgspec.field(default_factory=Time)
    epoch: uint32 = 0
    tick: uint64 = 0
    robots: Int32Seq = msgspec.field(default_factory=lambda: _NO_INT32)
    participants: list[str] = msgspec.field(default_factory=list)


class Done(Message):
    """Lock-step: a participant has finished `tick`."""

    ros_type: ClassVar[str] = "zteam_msgs/msg/Done"
    epoch: uint32 = 0
    tick: uint64 = 0
    has_command: bool_ = False
    command: Twist = msgspec.field(default_factory=Twist)


class RobotState:
    """Values of RobotStatus.state."""

    BOOT = 0
    READY = 1
    RUNNING = 2
    STOPPED = 3
    FAULT = 4

    TEXT: ClassVar[tuple[str, ...]] = ("boot", "ready", "running", "stopped", "fault")


class TeamState:
    """Values of TeamStatus.state."""

    WAITING = 0
    GO = 1

    TEXT: ClassVar[tuple[str, ...]] = ("waiting", "go")
