"""Bundles of transforms as the aggregator sends them."""

from zteam.messages import Header, Quaternion, Transform, TransformStamped, Vector3, time_from_ns

S = 1_000_000_000
ROBOTS = 5


def transform(robot: int, stamp: int, x: float, name: str = "robot") -> TransformStamped:
    """A robot's odometry."""
    pose = Transform(Vector3(x, float(robot)), Quaternion(0.0, 0.0, 0.0, 1.0))
    return TransformStamped(Header(time_from_ns(stamp), f"{name}_{robot}/odom"), f"{name}_{robot}/base_footprint", pose)


def bundle(tick: int, robots: range | list[int] = range(ROBOTS), name: str = "robot") -> list[TransformStamped]:
    """A tick's transforms."""
    return [transform(i, tick * S // 10, 0.1 * tick + i, name) for i in robots]
