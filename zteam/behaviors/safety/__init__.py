"""The safety layer, and how it is used: `ask` a behaviour, then `limit` what drives."""

from zteam.behaviors.safety.asking import ask, decide, make_safe, missing
from zteam.behaviors.safety.layer import SafetyLayer
from zteam.behaviors.safety.limits import LimitsOnly

__all__ = ["LimitsOnly", "SafetyLayer", "ask", "decide", "make_safe", "missing"]
