"""The layer under every behaviour: nothing moves on old data, into an obstacle, or faster than the limits.

Pure functions. Text that says why is the same from step to step, so that a robot's status changes only with the cause.
"""

import math
from collections.abc import Callable

from zteam import names
from zteam.behaviors.behavior import Behavior, checked_command
from zteam.behaviors.scans import first_clear, look_ahead, look_along
from zteam.behaviors.view import View
from zteam.messages import LaserScan, Twist, Vector3, ns_from_time

STALE_AFTER = 0.5
"""Seconds after which a scan, or the robot's own pose, is too old to move on."""
MAX_LINEAR = 1.0
"""m/s, forwards and backwards, also for a base that could go faster: Stage's own limit for a position model."""
MAX_ANGULAR = math.pi
"""rad/s, both ways, likewise."""
STOP_AHEAD = 0.35
"""Metres from the laser: 0.25 m ahead of the front of an erratic; its laser sits 0.1 m behind the front."""
SIDE_MARGIN = 0.025
"""Metres that have to be free on either side of the base."""
BLIND_ANGLE = math.radians(30.0)
BLIND_SHARE = 0.5
"""A robot is blind when more than this share of the beams within BLIND_ANGLE of straight ahead says nothing."""


OBSTACLE = "obstacle ahead"

Note = Callable[[Twist, str, View], None]
"""`note(wanted, trouble, view)`: what the behaviour wanted, and why the safety layer stopped it ("" if it did not)."""


def decide(behavior: Behavior, view: View, note: Note = lambda wanted, trouble, view: None) -> tuple[Twist, str]:
    """The safe velocity of a step, and why it is not what the behaviour is for ("" if it is)."""
    trouble = _old_data(view, behavior.uses_tf)
    if trouble:
        return Twist(), trouble
    wanted = checked_command(behavior.step(view), f"{type(behavior).__name__}.step")
    command, trouble = make_safe(wanted, view)
    note(wanted, trouble, view)
    return command, trouble or behavior.reason


def make_safe(wanted: Twist, view: View) -> tuple[Twist, str]:
    """`wanted` within the limits, without its forward part where something stands ahead; and why it was cut ("" = not).

    Only x and yaw are passed on: the bases have no other way to move.
    """
    trouble = _old_data(view, uses_tf=False)
    if trouble or view.scan is None:
        return Twist(), trouble
    x, turn = wanted.linear.x, wanted.angular.z
    if not (math.isfinite(x) and math.isfinite(turn)):
        return Twist(), "the behaviour asks for a velocity that is no number"
    base = view.base
    if x > 0.0:
        trouble = _ahead(view.scan, base.half_width + SIDE_MARGIN)
    x = 0.0 if trouble else max(-MAX_LINEAR, base.min_vel_x, min(MAX_LINEAR, base.max_vel_x, x))
    # A car's command is an angle of its wheels.
    limit = MAX_ANGULAR if base.drive == "car" else min(MAX_ANGULAR, base.max_vel_theta)
    return Twist(linear=Vector3(x=x), angular=Vector3(z=max(-limit, min(limit, turn)))), trouble


def missing(view: View, behavior: Behavior) -> list[str]:
    """What the robot lacks before it is ready, as nouns for its status; empty = ready."""
    lacking = []
    if view.scan is None:
        lacking.append(f"a first scan ({names.scan_key(view.robot_id, 0)})")
    if view.odom is None:
        lacking.append(f"odometry ({names.robot_key(view.robot_id, names.ODOM)})")
    if view.map_from_base() is None:
        lacking.append(f"its own pose in {names.MAP_FRAME} ({names.TF}, from zteam-tf)")
    return lacking + behavior.missing(view)


def _old_data(view: View, uses_tf: bool) -> str:
    if view.scan is None:
        return "no scan yet"
    if not view.is_fresh(ns_from_time(view.scan.header.stamp), STALE_AFTER):
        return "stale scan"
    if not uses_tf:
        return ""
    own = view.map_from_base()
    if own is None:
        return f"its own pose in {names.MAP_FRAME} is not known"
    return "" if not own[1] or view.is_fresh(own[1], STALE_AFTER) else f"its own pose in {names.MAP_FRAME} is stale"


def _ahead(scan: LaserScan, half_width: float) -> str:
    cone = look_ahead(scan, BLIND_ANGLE)
    if cone is None or cone.invalid > BLIND_SHARE:
        return "blind ahead"
    return OBSTACLE if first_clear(scan, half_width, (0.0,), STOP_AHEAD) is None else ""


def obstacle_distance(scan: LaserScan, half_width: float) -> float:
    """Metres from the laser to what stands in the way of a base of this half width, inf where it is clear."""
    return look_along(scan, half_width + SIDE_MARGIN)
