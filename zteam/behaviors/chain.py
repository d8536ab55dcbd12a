"""Robots that follow each other: which one leads them all, and where a robot is, if that is known for certain."""

import math

import msgspec

from zteam import names
from zteam.behaviors.view import View
from zteam.geometry import Pose2
from zteam.messages import RobotStatus

STATUSES = {"statuses": (names.all_robots_key(names.STATUS), RobotStatus)}
"""What a behaviour declares as `inputs` that asks for the chain."""


class Seen(msgspec.Struct, frozen=True):
    """Where a robot is."""

    pose: Pose2
    stamp: int
    """Nanoseconds; 0 where nothing on the way ever moves."""


def see_robot(view: View, robot_id: int, frame: str, stale_after: float) -> tuple[Seen | None, str]:
    """The leader `robot_id` in `frame`; or None and why not: its pose is not known, or older than `stale_after` s."""
    if robot_id == view.robot_id:
        return None, "it cannot follow itself"
    found = view.lookup(frame, names.robot_frame(robot_id, names.BASE_FOOTPRINT))
    if found is None:
        return None, f"leader {names.robot_name(robot_id)} not seen"
    pose, stamp = found
    # A stamp of 0 says that nothing on the way ever moves, so there is no age.
    if stamp and not view.is_fresh(stamp, stale_after):
        return None, f"leader {names.robot_name(robot_id)} not seen for {stale_after:g} s"
    if not all(map(math.isfinite, pose)):
        return None, f"the pose of leader {names.robot_name(robot_id)} is no number"
    return Seen(pose, stamp), ""


def behavior_of(view: View, robot: int) -> str:
    """The behaviour that a robot tells in its status; empty if it has told none."""
    status = (view.inputs.get("statuses") or {}).get(robot)
    return status.behavior if status is not None else ""
