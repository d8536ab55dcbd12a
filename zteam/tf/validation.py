"""What a transform must be to be stored, whatever the tree: names, numbers, a rotation."""

import math
from typing import NamedTuple

from zteam.tf.rigid import Floats

UNIT_TOLERANCE = 0.01
"""tf2 refuses a quaternion whose squared length is this far from 1."""

ROUNDING = 1e-15
"""A squared length that is this near to 1 is as near as doubles get: it is left alone."""


class Rejection(NamedTuple):
    """Why a transform was not stored: tf2's code, and a text."""

    code: str
    text: str


def check_names(parent: str, child: str, authority: str) -> Rejection | None:
    """Names without their leading slash."""
    if not child:
        return Rejection("TF_NO_CHILD_FRAME_ID", f"a transform from {authority} has no child_frame_id")
    if not parent:
        return Rejection("TF_NO_FRAME_ID", f"{child} from {authority} has no frame_id")
    if parent == child:
        return Rejection("TF_SELF_TRANSFORM", f"{child} from {authority} is its own parent")
    return None


def check_numbers(floats: Floats, child: str, authority: str) -> Rejection | None:
    """Finite, and a quaternion that is nearly a unit one."""
    if not all(map(math.isfinite, floats)):
        return Rejection("TF_NAN_INPUT", f"{child} from {authority} holds a number that is not finite")
    _, _, _, i, j, k, w = floats
    if abs(i * i + j * j + k * k + w * w - 1.0) >= UNIT_TOLERANCE:
        return Rejection(
            "TF_DENORMALIZED_QUATERNION", f"{child} from {authority} has a rotation that is no unit quaternion"
        )
    return None


def normalise(floats: Floats) -> Floats:
    """The same with a unit quaternion."""
    x, y, z, i, j, k, w = floats
    square = i * i + j * j + k * k + w * w
    if abs(square - 1.0) < ROUNDING:
        return floats
    scale = square**-0.5
    return (x, y, z, i * scale, j * scale, k * scale, w * scale)
