"""Requests and replies of a robot's navigation: `robot_N/navigation/cancel` and so on."""

import msgspec

from zteam import names
from zteam.bus import Change

CANCEL = "cancel"
GLOBAL_LOCALIZATION = "global_localization"


def navigation_query(robot_id: int, service: str) -> str:
    """Key of a query of the navigation of robot `robot_id`; `info` tells which process it is."""
    return names.service_key(names.robot_key(robot_id, names.NAVIGATION), service)


class CancelRequest(Change):
    """Give up the goal: the robot stops."""


class CancelReply(msgspec.Struct):
    """What became of the request. It counts from the next step on; the status then says `canceled`."""

    canceled: bool
    """Whether there was a goal to give up."""


class GlobalLocalizationRequest(Change):
    """Forget where the robot is: spread the particles over all of the map that is free."""


class GlobalLocalizationReply(msgspec.Struct):
    """What became of the request."""

    refused: str = ""
    """Why nothing was done, such as for a localiser without particles; empty if it was."""
