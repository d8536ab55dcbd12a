"""What robots do: pure, deterministic, observations in, velocities out."""

from zteam.messages.base import Base
from zteam.robot.behaviors.behavior import Behavior
from zteam.robot.behaviors.registry import load_behavior
from zteam.robot.scans import Cone, first_clear, look_ahead, look_along, read_beams
from zteam.robot.view import FindPose, Teammate, View

__all__ = [
    "Base",
    "Behavior",
    "Cone",
    "FindPose",
    "Teammate",
    "View",
    "first_clear",
    "load_behavior",
    "look_ahead",
    "look_along",
    "read_beams",
]
