"""How a robot of a formation comes to its slot, past walls and robots, and how it stays in it."""

import math

from zteam.behaviors.leader_trail import LeaderTrail
from zteam.behaviors.pursuit import Limits
from zteam.behaviors.scans import is_clear
from zteam.behaviors.view import View
from zteam.geometry import Pose2, normalize_angle
from zteam.messages import Twist, Vector3

SLOT_GAIN, TURN_GAIN = 2.0, 3.0
"""1/s: speed towards the slot, and turn rate."""
SPOT_ANGLE = 1.0
"""Radians: it turns on the spot towards a direction that is further off."""
STANDING = 0.02
"""m/s: what is slower stands."""
LEAST_FORWARD = 0.05
"""m/s along the slot's heading while the slot moves: a robot ahead of its slot waits for it and does not turn back."""
ALIGNED = 0.05
"""Radians to a heading from which on it does not turn."""
ALONG, MARGIN = 0.4, 0.03
"""Metres between the places of the trail to which it looks, and that have to be free beside it on the way there."""


def hold(slot: Pose2, speed: float, turn: float, limits: Limits) -> Twist:
    """The velocity that keeps a robot in a slot that is near (own base frame) and moves (m/s ahead, rad/s)."""
    cos, sin = math.cos(slot.yaw), math.sin(slot.yaw)
    forward, side = speed + SLOT_GAIN * (cos * slot.x + sin * slot.y), SLOT_GAIN * (cos * slot.y - sin * slot.x)
    if speed > STANDING:
        forward = max(forward, LEAST_FORWARD)
    wanted, angle = math.hypot(forward, side), normalize_angle(math.atan2(side, forward) + slot.yaw)
    if wanted < STANDING:
        return Twist()
    ahead = min(wanted, limits.linear) * math.cos(angle) if abs(angle) < SPOT_ANGLE else 0.0
    return Twist(Vector3(ahead), Vector3(z=_limit(TURN_GAIN * angle + turn, limits)))


def turn_to(angle: float, limits: Limits) -> Twist:
    """Turn on the spot by this angle (rad)."""
    return Twist(angular=Vector3(z=0.0 if abs(angle) < ALIGNED else _limit(TURN_GAIN * angle, limits)))


def _limit(turn: float, limits: Limits) -> float:
    return max(-limits.angular, min(limits.angular, turn))


def find_goal(view: View, here: Pose2, slot: Pose2, speed: float, trail: LeaderTrail, place: float) -> Pose2:
    """Where to drive that is far from its slot, which moves (m/s) at this place of the trail; in the own base frame.

    It goes along the trail where a wall is between. `here` is the own pose in map.
    """
    if not _is_in_sight(view, slot):
        to_base, path = here.inverse(), trail.path
        while place > path.start:
            seen = to_base.compose(path.at(place))
            if math.hypot(seen.x, seen.y) > ALONG and _is_in_sight(view, seen):
                return seen
            place -= ALONG
    # So far ahead that the robot has the slot's speed when it is there.
    return slot.compose(Pose2(max(0.0, speed) / SLOT_GAIN, 0.0, 0.0))


def _is_in_sight(view: View, place: Pose2) -> bool:
    """Whether there is room for the robot all the way to a place in its base frame."""
    reach, bearing = math.hypot(place.x, place.y), math.atan2(place.y, place.x)
    return view.scan is None or is_clear(view.scan, view.base.half_width + MARGIN, reach, bearing)
