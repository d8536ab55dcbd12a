"""The checks of a single transform before it is stored: its names, its numbers and its rotation."""

import math
from typing import NamedTuple

from zteam.tf.rigid import Floats

UNIT_TOLERANCE = 0.01
"""tf2 refuses a quaternion whose squared length is this far from 1."""

ROUNDING = 1e-15
"""A quaternion whose squared length differs from 1 by less than this is not scaled: that is rounding of doubles."""


class Rejection(NamedTuple):
    """Why a transform was not stored: tf2's code, and a text."""

    code: str
    text: str


def check_names(parent: str, child: str, authority: str) -> Rejection | None:
    """Check two frame names without a leading slash; None, or why they are refused."""
    if not child:
        return Rejection("TF_NO_CHILD_FRAME_ID", f"a transform from {authority} has no child_frame_id")
    if not parent:
        return Rejection("TF_NO_FRAME_ID", f"{child} from {authority} has no frame_id")
    if parent == child:
        return Rejection("TF_SELF_TRANSFORM", f"{child} from {authority} is its own parent")
    return None


def check_numbers(floats: Floats, child: str, authority: str) -> Rejection | None:
    """Check that all numbers are finite and the quaternion is nearly a unit one; None, or why they are refused."""
    if not all(map(math.isfinite, floats)):
        return Rejection("TF_NAN_INPUT", f"{child} from {authority} holds a number that is not finite")
    _, _, _, i, j, k, w = floats
    if abs(i * i + j * j + k * k + w * w - 1.0) >= UNIT_TOLERANCE:
        return Rejection(
            "TF_DENORMALIZED_QUATERNION", f"{child} from {authority} has a rotation that is no unit quaternion"
        )
    return None


def normalise(floats: Floats) -> Floats:
    """The same transform with its quaternion scaled to length 1."""
    x, y, z, i, j, k, w = floats
    square = i * i + j * j + k * k + w * w
    if abs(square - 1.0) < ROUNDING:
        return floats
    scale = square**-0.5
    return (x, y, z, i * scale, j * scale, k * scale, w * scale)
