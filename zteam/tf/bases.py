"""The transforms of the robots' bases, which tell the tick that a message of transforms belongs to.

Frames of other processes do not: their stamps may be of the tick before, or of the future.
"""

from functools import lru_cache

from zteam import names
from zteam.messages import TFMessage, TransformStamped, ns_from_time


def is_base(transform: TransformStamped) -> bool:
    """Whether it places the base of a robot; its frames have their names of the team's tree."""
    return _is_base(transform.child_frame_id)


@lru_cache(maxsize=4096)
def _is_base(child: str) -> bool:
    return names.is_robot_frame(names.strip_slash(child), names.BASE_FOOTPRINT)


def bases_stamp(message: TFMessage) -> int:
    """The stamp (ns) of the last base in a message of `tf`; 0 without one."""
    return next((ns_from_time(t.header.stamp) for t in reversed(message.transforms) if is_base(t)), 0)


def base_stamp(robot_id: int, message: TFMessage) -> int:
    """The stamp (ns) of the base in a message of `robot_N/tf`, in which names may be relative; -1 without one."""
    newest = -1
    for transform in message.transforms:
        if _is_base_of(robot_id, transform.child_frame_id):
            newest = max(newest, ns_from_time(transform.header.stamp))
    return newest


@lru_cache(maxsize=4096)
def _is_base_of(robot_id: int, child: str) -> bool:
    return names.resolve_frame(names.robot_name(robot_id), child) == names.robot_frame(robot_id, names.BASE_FOOTPRINT)
