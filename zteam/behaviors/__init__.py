"""What robots do: pure, deterministic, observations in, velocities out."""

from zteam.base import Base
from zteam.behaviors.behavior import Behavior, FindPose, Teammate, View
from zteam.behaviors.registry import load_behavior
from zteam.behaviors.safety import SafetyLayer, decide, make_safe, missing
from zteam.behaviors.scans import Cone, first_clear, look_ahead, look_along, read_beams

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
