"""`up/start`: what `zteam up` is asked for when a robot lacks a process, such as one that was spawned."""

from typing import Annotated

import msgspec

from zteam import names
from zteam.bus import Bus, Change

START_LIMIT = 10.0
"""Host seconds for the launcher's answer; it makes a certificate first where the team has them."""


class StartRequest(Change):
    """Start the process of a robot, with a behaviour that zteam knows and that needs no parameters."""

    robot: Annotated[int, msgspec.Meta(ge=0, le=names.MAX_ROBOT_ID)]
    behavior: str


def start_robot(bus: Bus, robot_id: int, behavior: str) -> None:
    """Ask the launcher to start a robot's process; its status and its log tell what becomes of it. Raises BusError."""
    key = names.service_key(names.LAUNCHER, names.START)
    bus.ask(key, str, StartRequest(robot=robot_id, behavior=behavior), timeout=START_LIMIT)
