"""The frames that a robot may publish: those below its own prefix, under its own frames or the global ones.

A robot may write a frame as a local name (`odom`), with its prefix (`robot_1/odom`) or with a leading slash. All three
spellings are resolved to the same full name here.
"""

from collections.abc import Iterable

from zteam import names
from zteam.messages import Header, TransformStamped
from zteam.tf.conflicts import Conflicts


def resolve(prefix: str, transform: TransformStamped) -> TransformStamped:
    """The transform with full names: `prefix` is put before local ones. Its stamp and numbers stay."""
    header = Header(transform.header.stamp, names.resolve_frame(prefix, transform.header.frame_id))
    return TransformStamped(header, names.resolve_frame(prefix, transform.child_frame_id), transform.transform)


def keep_own(robot_id: int, transforms: Iterable[TransformStamped], conflicts: Conflicts) -> list[TransformStamped]:
    """The transforms that the robot may publish, with full names; the others are reported to `conflicts`."""
    prefix, kept = names.robot_name(robot_id), []
    for transform in transforms:
        resolved = resolve(prefix, transform)
        child, parent = resolved.child_frame_id, resolved.header.frame_id
        if not _is_below(prefix, child):
            conflicts.report(child, prefix, "foreign", f"{prefix} may not say where {child or 'nothing'} is")
        elif not _is_below(prefix, parent) and parent not in names.GLOBAL_FRAMES:
            conflicts.report(child, prefix, "foreign", f"{prefix} may not hang {child} under {parent or 'nothing'}")
        else:
            kept.append(resolved)
    return kept


def _is_below(prefix: str, frame: str) -> bool:
    """Whether `frame` is the prefix, a slash and a name that is not empty."""
    return frame.startswith(prefix + "/") and len(frame) > len(prefix) + 1


def is_start_pose(transform: TransformStamped) -> bool:
    """Whether this is a `map -> robot_N/odom`: the only edge that may have several sources."""
    return transform.header.frame_id == names.MAP_FRAME and names.is_robot_frame(transform.child_frame_id, names.ODOM)
