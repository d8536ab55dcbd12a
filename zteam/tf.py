"""The public names of tf2's buffer of transforms, and its exceptions (`zteam.transforms`)."""

from zteam.transforms import *  # noqa: F403
from zteam.transforms import __all__ as __all__
