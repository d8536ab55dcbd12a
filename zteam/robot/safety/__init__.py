"""The safety layer: it limits what drives a robot."""

from zteam.robot.safety.layer import SafetyLayer, make_safe

__all__ = ["SafetyLayer", "make_safe"]
