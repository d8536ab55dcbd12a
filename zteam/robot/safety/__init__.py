"""The safety layer, and how it is used: `ask` a behaviour, then `limit` what drives."""

from zteam.robot.safety.layer import SafetyLayer, ask, decide, make_safe, missing, old_data
from zteam.robot.safety.motion import LimitsOnly

__all__ = ["LimitsOnly", "SafetyLayer", "ask", "decide", "make_safe", "missing", "old_data"]
