"""What a behaviour wants, if its data is not old; and what a robot lacks before it is ready."""

from zteam import names
from zteam.behaviors.behavior import Behavior, checked_command
from zteam.behaviors.safety.layer import SafetyLayer, old_scan
from zteam.behaviors.safety.sight import STALE_AFTER
from zteam.behaviors.view import View
from zteam.messages import Twist


def ask(behavior: Behavior, view: View) -> tuple[Twist, str]:
    """The velocity that the behaviour wants, and why it is not what the behaviour is for ("" if it is).

    On old data it is not asked, and the velocity is zero.
    """
    trouble = old_scan(view) or (_old_pose(view) if behavior.uses_tf else "")
    if trouble:
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


def make_safe(wanted: Twist, view: View) -> tuple[Twist, str]:
    """What a new `SafetyLayer` makes of `wanted`, and why it was cut ("" = it was not)."""
    return SafetyLayer().limit(wanted, view)


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


def _old_pose(view: View) -> str:
    own = view.map_from_base()
    if own is None:
        return f"its own pose in {names.MAP_FRAME} is not known"
    return "" if not own[1] or view.is_fresh(own[1], STALE_AFTER) else f"its own pose in {names.MAP_FRAME} is stale"
