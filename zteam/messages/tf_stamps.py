"""The transforms of the robots' bases, which tell the tick that a message of transforms belongs to.

Frames of other processes do not: their stamps may be of the tick before, or of the future.
"""

from functools import lru_cache

from zteam import names
from zteam.messages import TFMessage, ns_from_time


@lru_cache(maxsize=4096)
def is_base(frame: str) -> bool:
    """Whether a frame of the team's tree is the base of a robot."""
    return names.is_robot_frame(names.strip_slash(frame), names.BASE_FOOTPRINT)


def bases_stamp(message: TFMessage) -> int:
    """The stamp (ns) of the last base in a message of `tf`; 0 without one."""
    return next((ns_from_time(t.header.stamp) for t in reversed(message.transforms) if is_base(t.child_frame_id)), 0)
