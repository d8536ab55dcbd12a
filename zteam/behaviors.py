"""The public names of behaviours: their base class, the view, and reading laser scans (`zteam.robot.behaviors`)."""

from zteam.robot.behaviors import *  # noqa: F403
from zteam.robot.behaviors import __all__ as __all__
