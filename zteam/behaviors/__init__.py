"""What robots do: pure, deterministic, observations in, velocities out."""

from zteam.behaviors.behavior import Behavior
from zteam.behaviors.registry import load_behavior
from zteam.behaviors.safety import decide, make_safe, missing
from zteam.behaviors.view import Lookup, View

__all__ = ["Behavior", "Lookup", "View", "decide", "load_behavior", "make_safe", "missing"]
