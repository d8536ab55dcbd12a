"""The public names of behaviours: their base class, the view, reading laser scans, and the safety layer below them."""

from zteam.messages.base import Base
from zteam.robot.behaviors.behavior import Behavior, decide, missing
from zteam.robot.behaviors.registry import load_behavior
from zteam.robot.safety.layer import SafetyLayer, make_safe
from zteam.robot.view import Cone, FindPose, Teammate, View, first_clear, look_ahead, look_along, read_beams

__all__ = [
    "Base",
    "Behavior",
    "Cone",
    "FindPose",
    "SafetyLayer",
    "Teammate",
    "View",
    "decide",
    "first_clear",
    "load_behavior",
    "look_ahead",
    "look_along",
    "make_safe",
    "missing",
    "read_beams",
]
