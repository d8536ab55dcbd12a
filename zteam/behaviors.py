"""The public names of behaviours: their base class, the view, reading laser scans, and the safety layer below them
(`zteam.robot.behaviors`, `zteam.robot.safety`)."""

from zteam.robot import behaviors
from zteam.robot.behaviors import *  # noqa: F403
from zteam.robot.behaviors.behavior import decide, missing
from zteam.robot.safety import SafetyLayer, make_safe

__all__ = [*behaviors.__all__, "SafetyLayer", "decide", "make_safe", "missing"]
