"""The query that gives a goal up, of whatever takes a robot's goals: its navigation, or the behaviour go_to."""

import msgspec

from zteam import names
from zteam.bus import Change

CANCEL = "cancel"


def navigation_query(robot_id: int, service: str) -> str:
    """Key of a query of the navigation of robot `robot_id`; `info` tells which process it is."""
    return names.service_key(names.robot_key(robot_id, names.NAVIGATION), service)


class CancelRequest(Change):
    """Give up the goal: the robot stops."""


class CancelReply(msgspec.Struct):
    """What became of the request. It counts from the next step on; the status then says `canceled`."""

    canceled: bool
    """Whether there was a goal to give up."""
