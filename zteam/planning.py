"""The public names of navigation without a bus (`zteam.navigation.planning`)."""

from zteam.navigation.planning import *  # noqa: F403
from zteam.navigation.planning import __all__ as __all__
