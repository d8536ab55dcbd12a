"""What a robot waits for before it drives: a place in the world, its first data, the rest of its team."""

import logging

from zteam import names
from zteam.errors import BusError
from zteam.messages import LaserScan, RobotState
from zteam.nodes.robot.driver import ALONE, Driver, Turn
from zteam.nodes.robot.inputs import Inputs
from zteam.runtime.lockstep import Participant
from zteam.runtime.process_node import ProcessNode
from zteam.services.simulator import absence_text, read_status

log = logging.getLogger("zteam")

_ANSWER_LIMIT = 0.5
"""Host seconds for the simulator to say which robots it has."""
_PATIENCE = 3
"""Looks, a second apart, until something that does not come is missing."""
_TELL_EVERY = 5
"""Seconds between two lines about the others that GO waits for."""


class Waiting:
    """Asked once a second by the main loop."""

    def __init__(self, node: ProcessNode, inputs: Inputs, driver: Driver, part: Participant) -> None:
        self._node = node
        self._inputs = inputs
        self._driver = driver
        self._part = part
        self._looks = 0
        self._ready_for = 0
        """Seconds since the robot is ready, or since the last line."""
        self._told = ""
        self._scan: LaserScan | None = None
        """The newest at the last look."""

    def find_absence(self) -> None:
        """Ask the simulator whether it has this robot, if no scan comes; say so if none runs. Not under the lock."""
        self._looks += 1
        # At the start all is on its way.
        if self._looks < _PATIENCE:
            return
        before, self._scan = self._scan, self._inputs.scan
        if self._scan is not before:
            self._driver.absence = ""
            return
        try:
            status = read_status(self._node.bus, _ANSWER_LIMIT)
        except BusError as error:
            log.debug("%s", error)
            return
        robot_id = self._driver.robot_id
        lacks = status is not None and robot_id not in status.robots
        name = names.robot_name(robot_id)
        self._driver.absence = f"{name} is {absence_text(robot_id, status.robots)}" if status and lacks else ""
        if status is None and not self._driver.is_alone and self._driver.readiness.released:
            # Without a gate nothing else says what the robot waits for.
            log.info("waiting for a first scan: %s", ALONE)
        self._driver.is_alone = status is None

    def begin_look(self) -> Turn | None:
        """A turn to find out what is missing: while nothing comes there is no other (under `node.changed`)."""
        if self._looks < _PATIENCE or self._part.active or self._driver.readiness.released or self._node.stopping:
            return None
        return self._driver.turn(self._node.clock.now(), 0)

    def tell(self) -> None:
        """Log what GO waits for, if that takes long (under `node.changed`)."""
        team = self._inputs.team
        if self._driver.readiness.state != RobotState.READY or team is None or not team.waiting_for:
            self._ready_for = 0
            return
        self._ready_for += 1
        if self._ready_for > _TELL_EVERY and team.waiting_for != self._told:
            self._ready_for, self._told = 0, team.waiting_for
            log.info("ready; GO waits for %s", team.waiting_for)
