"""How a behaviour is asked: only when what it drives by is there, and with the safety layer under its answer."""

from zteam import names
from zteam.messages import Twist
from zteam.messages.planar import checked_command
from zteam.robot.behaviors.behavior import Behavior
from zteam.robot.safety.layer import SafetyLayer, old_scan
from zteam.robot.safety.surroundings import STALE_AFTER
from zteam.robot.view import NO_POSE, View


def old_data(behavior: Behavior, view: View) -> str:
    """Why the behaviour cannot be asked: what it drives by is missing or old; empty if it can."""
    return old_scan(view) or (_old_pose(view) if behavior.uses_tf else "")


def ask(behavior: Behavior, view: View) -> tuple[Twist, str]:
    """The velocity that the behaviour wants, and why it is not what the behaviour is for ("" if it is).

    On old data it is not asked, and the velocity is zero.
    """
    if trouble := old_data(behavior, view):
        return Twist(), trouble
    wanted = checked_command(behavior.step(view), f"{type(behavior).__name__}.step")
    return wanted, behavior.reason


def decide(behavior: Behavior, view: View, layer: SafetyLayer | None = None) -> tuple[Twist, str]:
    """The safe velocity of a step of the behaviour, and why it is not what the behaviour is for ("" if it is).

    `layer` remembers what came before; without one this is the first step.
    """
    wanted, reason = ask(behavior, view)
    command, trouble = (layer or SafetyLayer()).limit(wanted, view, reason)
    return command, trouble or reason


def missing(view: View, behavior: Behavior) -> list[str]:
    """What the robot lacks before it is ready, as nouns for its status; empty = ready."""
    lacking = []
    if view.scan is None:
        lacking.append(view.scan_needs or f"a first scan ({names.scan_key(view.robot_id, 0)})")
    if view.odom is None:
        lacking.append(f"odometry ({names.robot_key(view.robot_id, names.ODOM)})")
    if view.map_from_base() is None:
        lacking.append(f"its own pose in {names.MAP_FRAME} ({names.TF}, from zteam-tf)")
    return lacking + behavior.missing(view)


def _old_pose(view: View) -> str:
    own = view.map_from_base()
    if own is None:
        return NO_POSE
    return "" if not own[1] or view.is_fresh(own[1], STALE_AFTER) else f"its own pose in {names.MAP_FRAME} is stale"
