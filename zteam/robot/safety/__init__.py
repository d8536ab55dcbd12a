"""The safety layer: it limits what drives a robot."""

from zteam.robot.safety.layer import SafetyLayer, make_safe
from zteam.robot.safety.motion import LimitsOnly

__all__ = ["LimitsOnly", "SafetyLayer", "make_safe"]
