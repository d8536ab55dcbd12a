"""The public names of Stage's world files (`zteam.simulator.world`)."""

from zteam.simulator.world import *  # noqa: F403
from zteam.simulator.world import __all__ as __all__
