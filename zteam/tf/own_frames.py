"""The frames that a robot may publish: those below its own prefix, under its own frames or the global ones.

A robot may write a frame as a local name (`odom`), with its prefix (`robot_1/odom`) or with a leading slash. All three
spellings are resolved to the same full name here.
"""

from collections.abc import Iterable
from functools import lru_cache
from typing import NamedTuple

from zteam import names
from zteam.messages import Header, TransformStamped
from zteam.tf.conflicts import Conflicts


def resolve(prefix: str, transform: TransformStamped) -> TransformStamped:
    """The transform with full names: `prefix` is put before local ones. Its stamp and numbers stay."""
    header = Header(transform.header.stamp, names.resolve_frame(prefix, transform.header.frame_id))
    return TransformStamped(header, names.resolve_frame(prefix, transform.child_frame_id), transform.transform)


def keep_own(robot_id: int, transforms: Iterable[TransformStamped], conflicts: Conflicts) -> list[TransformStamped]:
    """The transforms that the robot may publish, with full names; the others are reported to `conflicts`."""
    kept = []
    for transform in transforms:
        parent, child = transform.header.frame_id, transform.child_frame_id
        own = _own(robot_id, parent, child)
        if own.problem:
            conflicts.report(own.child, names.robot_name(robot_id), "foreign", own.problem)
        elif own.child == child and own.parent == parent:
            kept.append(transform)
        else:
            header = Header(transform.header.stamp, own.parent)
            kept.append(TransformStamped(header, own.child, transform.transform))
    return kept


class _Own(NamedTuple):
    """The full names of an edge, and why the robot may not publish it; empty if it may."""

    parent: str
    child: str
    problem: str


@lru_cache(maxsize=4096)
def _own(robot_id: int, parent: str, child: str) -> _Own:
    """What an edge of `robot_N/tf` is: nearly all messages have the frames of the one before."""
    prefix = names.robot_name(robot_id)
    parent, child = names.resolve_frame(prefix, parent), names.resolve_frame(prefix, child)
    if not _is_below(prefix, child):
        problem = f"{prefix} may not say where {child or 'nothing'} is"
    elif not _is_below(prefix, parent) and parent not in names.GLOBAL_FRAMES:
        problem = f"{prefix} may not hang {child} under {parent or 'nothing'}"
    else:
        problem = ""
    return _Own(parent, child, problem)


def _is_below(prefix: str, frame: str) -> bool:
    """Whether `frame` is the prefix, a slash and a name that is not empty."""
    return frame.startswith(prefix + "/") and len(frame) > len(prefix) + 1


def is_start_pose(transform: TransformStamped) -> bool:
    """Whether this is a `map -> robot_N/odom`: the only edge that may have several sources."""
    return transform.header.frame_id == names.MAP_FRAME and names.is_robot_frame(transform.child_frame_id, names.ODOM)
