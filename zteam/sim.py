"""The public names of the simulator as a Python object (`zteam.simulator.core`)."""

from zteam.simulator.core import *  # noqa: F403
from zteam.simulator.core import __all__ as __all__
