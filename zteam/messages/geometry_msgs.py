"""Types of geometry_msgs and tf2_msgs, as in ROS 2 Jazzy."""

from collections.abc import Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, ClassVar, overload

import msgspec

from zteam import names
from zteam.messages.message import Covariance, Message, float32, float64, zeros
from zteam.messages.std_msgs import Header, Stamped, Time, ns_from_time

if TYPE_CHECKING:
    from zteam.kernels.transforms import Rows


class Vector3(Message):
    """A free vector."""

    x: float64 = 0.0
    y: float64 = 0.0
    z: float64 = 0.0


class Point(Message):
    """A position in metres."""

    x: float64 = 0.0
    y: float64 = 0.0
    z: float64 = 0.0


class Quaternion(Message):
    """An orientation; identity by default."""

    x: float64 = 0.0
    y: float64 = 0.0
    z: float64 = 0.0
    w: float64 = 1.0


class Pose(Message):
    """Position and orientation."""

    position: Point = msgspec.field(default_factory=Point)
    orientation: Quaternion = msgspec.field(default_factory=Quaternion)


class PoseWithCovariance(Message):
    """A pose and its 6 by 6 covariance, row by row (x, y, z, roll, pitch, yaw)."""

    pose: Pose = msgspec.field(default_factory=Pose)
    covariance: Covariance = zeros("float64", 36)


class PoseStamped(Stamped):
    """A pose in a frame at a time."""

    pose: Pose = msgspec.field(default_factory=Pose)


class PoseWithCovarianceStamped(Stamped):
    """A pose and its covariance in a frame at a time."""

    pose: PoseWithCovariance = msgspec.field(default_factory=PoseWithCovariance)


class PoseArray(Stamped):
    """Poses in one frame at one time, such as the particles of a localiser."""

    poses: list[Pose] = msgspec.field(default_factory=list)


class Point32(Message):
    """A position in metres, in less space."""

    x: float32 = 0.0
    y: float32 = 0.0
    z: float32 = 0.0


class Polygon(Message):
    """A closed outline in metres: the last point is joined to the first."""

    points: list[Point32] = msgspec.field(default_factory=list)


class PolygonStamped(Stamped):
    """An outline in a frame at a time, such as a robot's footprint."""

    polygon: Polygon = msgspec.field(default_factory=Polygon)


class PointStamped(Stamped):
    """A point in a frame at a time."""

    point: Point = msgspec.field(default_factory=Point)


class Vector3Stamped(Stamped):
    """A direction or a difference in a frame at a time: turned by transforms, not moved."""

    vector: Vector3 = msgspec.field(default_factory=Vector3)


class Twist(Message):
    """Velocity: linear in m/s, angular in rad/s."""

    linear: Vector3 = msgspec.field(default_factory=Vector3)
    angular: Vector3 = msgspec.field(default_factory=Vector3)


class TwistStamped(Stamped):
    """A velocity in a frame at a time."""

    twist: Twist = msgspec.field(default_factory=Twist)


class TwistWithCovariance(Message):
    """A velocity and its 6 by 6 covariance, row by row."""

    twist: Twist = msgspec.field(default_factory=Twist)
    covariance: Covariance = zeros("float64", 36)


class Transform(Message):
    """A rigid transform."""

    translation: Vector3 = msgspec.field(default_factory=Vector3)
    rotation: Quaternion = msgspec.field(default_factory=Quaternion)


class TransformStamped(Stamped):
    """The pose of `child_frame_id` in `header.frame_id` at `header.stamp`."""

    child_frame_id: str = ""
    transform: Transform = msgspec.field(default_factory=Transform)

    @staticmethod
    def read_rows(payload: bytes, at: int, end: int, count: int) -> "tuple[TransformRows, int] | None":
        """Read `count` transforms for the codec: they, and where they end; None if it has to read them one by one."""
        if count < 2:
            # A single one is looked at anyway.
            return None
        # Imported here: a process that reads no bundles needs no kernels.
        from zteam.kernels.transforms import read_transforms

        read = read_transforms(payload, at, end, count)
        return None if read is None else (TransformRows(read[0]), read[1])


class TransformRows(Sequence[TransformStamped]):
    """The transforms of a message as its bytes hold them. Each is made when it is looked at."""

    def __init__(self, rows: "Rows") -> None:
        self.rows = rows
        """For kernels."""

    def __len__(self) -> int:
        return len(self.rows)

    @overload
    def __getitem__(self, at: int) -> TransformStamped: ...
    @overload
    def __getitem__(self, at: slice) -> list[TransformStamped]: ...
    def __getitem__(self, at: int | slice) -> TransformStamped | list[TransformStamped]:
        if isinstance(at, slice):
            return [self[place] for place in range(*at.indices(len(self)))]
        place = at if at >= 0 else at + len(self)
        if not 0 <= place < len(self):
            raise IndexError(at)
        sec, nanosec, parent, child, x, y, z, i, j, k, w = self.rows[place]
        return TransformStamped(
            Header(Time(sec, nanosec), parent), child, Transform(Vector3(x, y, z), Quaternion(i, j, k, w))
        )

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Sequence) and [*self] == [*other]

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        return repr([*self])

    def __reduce__(self) -> tuple[type, tuple[list[TransformStamped]]]:
        """A copy, also one that is pickled, is a list: its bytes may be gone."""
        return list, ([*self],)


class TFMessage(Message):
    """Transforms that were sent together."""

    ros_type: ClassVar[str] = "tf2_msgs/msg/TFMessage"
    transforms: list[TransformStamped] = msgspec.field(default_factory=list)
    """Of a message that was received a sequence that cannot be changed, as arrays are."""


@lru_cache(maxsize=4096)
def is_base(frame: str) -> bool:
    """Whether a frame of the team's tree is the base of a robot."""
    return names.is_robot_frame(names.strip_slash(frame), names.BASE_FOOTPRINT)


def bases_stamp(message: TFMessage) -> int:
    """The stamp (ns) of the last base in a message of `tf`, which tells its tick; 0 without one.

    Frames of other processes do not: their stamps may be of the tick before, or of the future.
    """
    return next((ns_from_time(t.header.stamp) for t in reversed(message.transforms) if is_base(t.child_frame_id)), 0)
