"""Rotations and rigid transforms on plain floats: numpy is slower for so few numbers.

Axes follow REP 103: x forward, y left, z up. Quaternions are (x, y, z, w) as in ROS. A planar pose is (x, y, yaw). A
transform named `target_from_source` maps coordinates in `source` to coordinates in `target`.
"""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

Point2 = tuple[float, float]
"""Metres."""
FAR = 1e8
"""Metres: what is longer, or further from the origin of the map, is a mistake.

Coordinates of a country's grid (UTM, also with the zone before the easting) are less, and a double holds them to 15 nm.
"""


class Pose2(NamedTuple):
    """A pose in the plane: metres and radians.

    The pose of `b` in `a` is also the transform `a_from_b`, so `a_from_b.compose(b_from_c)` is `a_from_c`.
    """

    x: float
    y: float
    yaw: float

    def compose(self, b_from_c: "Pose2") -> "Pose2":
        """The pose of `c` in `a`: this is the pose of `b` in `a`, the argument is that of `c` in `b`."""
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        return Pose2(
            self.x + c * b_from_c.x - s * b_from_c.y,
            self.y + s * b_from_c.x + c * b_from_c.y,
            normalize_angle(self.yaw + b_from_c.yaw),
        )

    def inverse(self) -> "Pose2":
        """The pose of `a` in `b`: this is the pose of `b` in `a`."""
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        return Pose2(-c * self.x - s * self.y, s * self.x - c * self.y, normalize_angle(-self.yaw))

    def locate(self, x: float, y: float) -> tuple[float, float]:
        """Where a point of `a` is in `b`: this is the pose of `b` in `a`."""
        dx, dy, c, s = x - self.x, y - self.y, math.cos(self.yaw), math.sin(self.yaw)
        return c * dx + s * dy, c * dy - s * dx


class Velocity(NamedTuple):
    """The velocity of a base in the plane: kept, it is an arc, a straight line or a turn on the spot."""

    x: float = 0.0
    """m/s, forwards."""
    y: float = 0.0
    """m/s, to the left."""
    turn: float = 0.0
    """rad/s, to the left."""

    @property
    def speed(self) -> float:
        """m/s of the base's origin."""
        return math.hypot(self.x, self.y) if self.y else abs(self.x)

    def scale(self, share: float) -> "Velocity":
        """The same arc, driven at a share of its speed."""
        return Velocity(self.x * share, self.y * share, self.turn * share)


def curvature_to(y: float, square: float) -> float:
    """1/m, left positive: of the arc that leads from a robot to a point `y` metres to its left, `square` m² away.

    This is the law of pure pursuit (Coulter 1992). `square` is the distance squared, at least 1 mm².
    """
    return 2.0 * y / max(square, 1e-6)


Quat = tuple[float, float, float, float]
Vec3 = tuple[float, float, float]


def turn_problem(angle: float) -> str:
    """What is wrong with an angle that a user gave in radians; empty if it is at most one full turn."""
    if abs(angle) <= 2.0 * math.pi + 1e-9:
        return ""
    return f"{angle:g} is more than a full turn; angles are radians ({angle:g} degrees are {math.radians(angle):.4f})"


def normalize_angle(angle: float) -> float:
    """The equivalent angle in (-pi, pi], radians."""
    wrapped = math.fmod(angle, math.tau)
    if wrapped > math.pi:
        return wrapped - math.tau
    if wrapped <= -math.pi:
        return wrapped + math.tau
    return wrapped


def quaternion_from_yaw(yaw: float) -> Quat:
    """Rotation about z by `yaw`."""
    return (0.0, 0.0, math.sin(0.5 * yaw), math.cos(0.5 * yaw))


def yaw_from_quaternion(x: float, y: float, z: float, w: float) -> float:
    """Heading of a unit quaternion: the yaw of its fixed-axis roll, pitch, yaw."""
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def quaternion_from_rpy(roll: float, pitch: float, yaw: float) -> Quat:
    """Fixed-axis roll, pitch, yaw (tf2's setRPY): R = Rz(yaw) Ry(pitch) Rx(roll)."""
    cr, sr = math.cos(0.5 * roll), math.sin(0.5 * roll)
    cp, sp = math.cos(0.5 * pitch), math.sin(0.5 * pitch)
    cy, sy = math.cos(0.5 * yaw), math.sin(0.5 * yaw)
    return (
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        cr * cp * cy + sr * sp * sy,
    )


def rpy_from_quaternion(x: float, y: float, z: float, w: float) -> Vec3:
    """Fixed-axis (roll, pitch, yaw) of a unit quaternion; pitch in [-pi/2, pi/2], roll 0 at the poles."""
    sin_pitch = 2.0 * (w * y - z * x)
    if abs(sin_pitch) >= 1.0 - 1e-12:
        # Gimbal lock: only roll -/+ yaw is defined; put all of it into yaw.
        pitch = math.copysign(0.5 * math.pi, sin_pitch)
        return (0.0, pitch, normalize_angle(-math.copysign(2.0, sin_pitch) * math.atan2(x, w)))
    roll = math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    return (roll, math.asin(sin_pitch), yaw_from_quaternion(x, y, z, w))


def signed_area(points: Sequence[Point2]) -> float:
    """Area of a polygon, positive if counter-clockwise."""
    pairs = zip(points, (*points[1:], points[0]), strict=True)
    return 0.5 * sum(ax * by - bx * ay for (ax, ay), (bx, by) in pairs)


def _turn(a: Point2, b: Point2, c: Point2) -> float:
    """Above 0 if the way a, b, c turns left."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def is_convex(points: Sequence[Point2]) -> bool:
    """Whether a simple, counter-clockwise polygon turns right nowhere."""
    return all(_turn(points[i - 2], points[i - 1], point) >= 0 for i, point in enumerate(points))


def convex_hull(points: Sequence[Point2]) -> tuple[Point2, ...]:
    """Smallest convex polygon around the points, counter-clockwise (Andrew's monotone chain)."""
    ordered = sorted(set(points))
    return (*_chain(ordered), *_chain(ordered[::-1]))


def _chain(points: Sequence[Point2]) -> list[Point2]:
    chain: list[Point2] = []
    for point in points:
        while len(chain) > 1 and _turn(chain[-2], chain[-1], point) <= 0:
            chain.pop()
        chain.append(point)
    return chain[:-1]


def in_polygon(
    polygon: "NDArray[np.float64]", x: "NDArray[np.floating] | float", y: "NDArray[np.floating] | float"
) -> "NDArray[np.bool_]":
    """For each point (arrays that broadcast) whether it lies in a polygon (n, 2), by the even-odd rule."""
    import numpy as np  # Commands import this module to read their options.

    inside = np.zeros(np.broadcast_shapes(np.shape(x), np.shape(y)), bool)
    for (ax, ay), (bx, by) in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        if ay != by:
            inside ^= ((ay > y) != (by > y)) & (x < ax + (y - ay) * (bx - ax) / (by - ay))
    return inside
