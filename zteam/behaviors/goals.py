"""Goals as they come from outside: a PoseStamped in any frame, read once, with all its mistakes."""

import math

from zteam import names
from zteam.behaviors.view import View
from zteam.geometry import Pose2, yaw_from_quaternion
from zteam.messages import PoseStamped

REFUSED = "the goal is refused: "
"""Begins every reason for which a goal is not taken."""
_LEAST_NORM = 1e-3
"""A shorter quaternion is no orientation; any other is taken for its direction."""
FAR = 1e6
"""Metres: no goal lies further from the origin of the map."""


def read_goal(message: PoseStamped, view: View) -> tuple[Pose2 | None, str]:
    """The goal in `map`, or None and why it is refused.

    A goal in another frame is taken to `map` with the newest transform.
    """
    pose, refusal = _planar(message)
    if pose is None:
        return None, refusal
    frame = message.header.frame_id.lstrip("/")
    if not frame:
        return None, f"{REFUSED}it names no frame; use {names.MAP_FRAME}"
    if frame == names.MAP_FRAME:
        return pose, ""
    found = view.lookup(names.MAP_FRAME, frame)
    if found is None or not all(map(math.isfinite, found[0])):
        return None, f"{REFUSED}its frame {frame} has no transform to {names.MAP_FRAME}"
    return found[0].compose(pose), ""


def _planar(message: PoseStamped) -> tuple[Pose2 | None, str]:
    place, turn = message.pose.position, message.pose.orientation
    norm = math.hypot(turn.x, turn.y, turn.z, turn.w)
    if not all(map(math.isfinite, (place.x, place.y, norm))):
        return None, f"{REFUSED}it has a value that is no number"
    if abs(place.x) > FAR or abs(place.y) > FAR:
        return None, f"{REFUSED}it is more than {FAR / 1e3:g} km away"
    if norm < _LEAST_NORM:
        return None, f"{REFUSED}its orientation is zero; use w = 1 for none"
    yaw = yaw_from_quaternion(*(part / norm for part in (turn.x, turn.y, turn.z, turn.w)))
    return Pose2(place.x, place.y, yaw), ""
