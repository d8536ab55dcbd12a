"""Transforms and answers as tf2 recorded them, beside ours."""

from typing import Any

from zteam.messages import Header, Quaternion, Transform, TransformStamped, Vector3, ns_from_time, time_from_ns
from zteam.tf import TransformException

TOLERANCE = 1e-9


def stamped(parent: str, child: str, stamp: int, xf: list[float]) -> TransformStamped:
    """`xf` is x, y, z, qx, qy, qz, qw."""
    return TransformStamped(
        Header(time_from_ns(stamp), parent), child, Transform(Vector3(*xf[:3]), Quaternion(*xf[3:]))
    )


def _numbers(transform: TransformStamped) -> list[float]:
    t, r = transform.transform.translation, transform.transform.rotation
    return [t.x, t.y, t.z, r.x, r.y, r.z, r.w]


def agrees(recorded: list[Any], answer: TransformStamped | TransformException) -> bool:
    """Whether an answer is the recorded one: stamp, seven numbers to TOLERANCE, or the class of the exception."""
    if isinstance(answer, TransformException):
        return any(kind.__name__ == recorded[0] for kind in type(answer).__mro__)
    if isinstance(recorded[0], str):
        return False
    ours = _numbers(answer)
    sign = 1.0 if sum(a * b for a, b in zip(ours[3:], recorded[4:], strict=True)) > 0 else -1.0
    ours[3:] = [sign * q for q in ours[3:]]
    close = all(abs(a - b) <= TOLERANCE for a, b in zip(ours, recorded[1:], strict=True))
    return close and ns_from_time(answer.header.stamp) == recorded[0]
