"""Poses, paths and costmaps as messages."""

import math

import numpy as np
from numpy.typing import NDArray

from zteam import names
from zteam.geometry import Pose2, quaternion_from_yaw
from zteam.messages import (
    Header,
    MapMetaData,
    OccupancyGrid,
    Path,
    Point,
    Point32,
    Polygon,
    PolygonStamped,
    Pose,
    PoseArray,
    PoseStamped,
    PoseWithCovariance,
    PoseWithCovarianceStamped,
    Quaternion,
    TFMessage,
    Time,
    Transform,
    TransformStamped,
    Twist,
    TwistStamped,
    Vector3,
)
from zteam.planning.controller import Velocity
from zteam.planning.costmap import (
    INSCRIBED_INFLATED_OBSTACLE,
    LETHAL_OBSTACLE,
    NO_INFORMATION,
    Costmap,
    Footprint,
    place,
)

Floats = NDArray[np.float64]


def _values_of_costs() -> NDArray[np.int8]:
    """Costmap2DPublisher's table of Nav2: costs as values of an OccupancyGrid."""
    table = np.array([1 + (97 * (cost - 1)) // 251 for cost in range(256)]).astype(np.int8)
    table[0], table[INSCRIBED_INFLATED_OBSTACLE], table[LETHAL_OBSTACLE], table[NO_INFORMATION] = 0, 99, 100, -1
    return table


_VALUES = _values_of_costs()


def header_of(stamp: Time) -> Header:
    """A header of `map`."""
    return Header(stamp, names.MAP_FRAME)


def pose_message(pose: Pose2) -> Pose:
    """A pose in the plane."""
    return Pose(Point(pose.x, pose.y), Quaternion(*quaternion_from_yaw(pose.yaw)))


def path_message(stamp: Time, path: Floats) -> Path:
    """Poses (n, 3) as a path."""
    header = header_of(stamp)
    return Path(header, [PoseStamped(header, pose_message(Pose2(*row))) for row in path.tolist()])


def poses_message(stamp: Time, poses: Floats) -> PoseArray:
    """Particles (n, 3)."""
    return PoseArray(header_of(stamp), [pose_message(Pose2(*row)) for row in poses.tolist()])


def pose_estimate_message(stamp: Time, pose: Pose2, covariance: Floats) -> PoseWithCovarianceStamped:
    """A pose with its covariance (3, 3) of x, y, yaw."""
    whole = np.zeros((6, 6))
    kept = np.ix_((0, 1, 5), (0, 1, 5))
    whole[kept] = covariance
    return PoseWithCovarianceStamped(header_of(stamp), PoseWithCovariance(pose_message(pose), whole.ravel()))


def footprint_message(stamp: Time, footprint: Footprint, pose: Pose2) -> PolygonStamped:
    """The outline of a robot at `pose`."""
    points = [Point32(x, y) for x, y in place(footprint, *pose).tolist()]
    return PolygonStamped(header_of(stamp), Polygon(points))


def costmap_message(stamp: Time, costmap: Costmap) -> OccupancyGrid:
    """A costmap as Nav2 shows it: 99 inscribed, 100 lethal, -1 unknown."""
    frame = costmap.frame
    info = MapMetaData(stamp, frame.resolution, frame.columns, frame.rows, pose_message(frame.origin))
    return OccupancyGrid(header_of(stamp), info, _VALUES[costmap.costs].ravel())


def velocity_message(stamp: Time, frame: str, velocity: Velocity) -> TwistStamped:
    """A command of the tick of `stamp`, in the base frame."""
    twist = Twist(Vector3(velocity.x, velocity.y), Vector3(0.0, 0.0, velocity.turn))
    return TwistStamped(Header(stamp, frame), twist)


def transform_message(stamp: Time, child: str, pose: Pose2) -> TFMessage:
    """`map -> child`."""
    transform = Transform(Vector3(pose.x, pose.y), Quaternion(*quaternion_from_yaw(pose.yaw)))
    return TFMessage([TransformStamped(header_of(stamp), child, transform)])


def is_finite(pose: Pose2) -> bool:
    """Whether a pose can be sent."""
    return all(map(math.isfinite, pose))
