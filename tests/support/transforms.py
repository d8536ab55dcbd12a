"""Transforms by hand, for tests of everything that stores or asks for them."""

import math

from zteam import names
from zteam.messages import Header, Quaternion, TFMessage, Transform, TransformStamped, Vector3, time_from_ns
from zteam.tf import Buffer

S = 1_000_000_000


def stamped(parent: str, child: str, stamp: int, x: float = 0.0, y: float = 0.0, yaw: float = 0.0) -> TransformStamped:
    """A planar transform."""
    rotation = Quaternion(0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2))
    return TransformStamped(Header(time_from_ns(stamp), parent), child, Transform(Vector3(x, y, 0.0), rotation))


def laser_on(robot_id: int) -> TFMessage:
    """What a base says of its laser: that it is in its origin."""
    base, laser = (names.robot_frame(robot_id, each) for each in (names.BASE_FOOTPRINT, names.BASE_LASER_LINK))
    return TFMessage([stamped(base, laser, 0)])


def chain(count: int) -> Buffer:
    """f0 → f1 → … → f<count>, one metre each, all fixed."""
    buffer = Buffer()
    for i in range(count):
        assert buffer.set_transform_static(stamped(f"f{i}", f"f{i + 1}", 0, 1.0), "test") is None
    return buffer
