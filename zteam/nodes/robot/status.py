"""What the robot says of itself: published at 1 Hz and when its state or its text changes, and logged."""

import logging

from zteam import names
from zteam.messages import Header, RobotDriver, RobotState, RobotStatus, Twist, time_from_ns
from zteam.nodes.robot.readiness import Readiness
from zteam.runtime.node import Node

log = logging.getLogger("zteam")

_IDLE = "the behaviour commands zero velocity"


class StatusReport:
    """Publishes the status of robot `robot_id`. The caller holds `node.changed`."""

    def __init__(self, node: Node, robot_id: int, behavior: str, readiness: Readiness) -> None:
        """`behavior` is what the robot was started with, such as `follow` or `my_robot:Turner`."""
        self._node = node
        self._id = robot_id
        self.behavior = behavior
        self.readiness = readiness
        self.leader: int | None = None
        self.command: Twist | None = None
        """The newest command; None while nothing commands the wheels."""
        self._told: tuple[int, str] = (readiness.state, readiness.reason)
        self._publisher = node.bus.publisher(names.robot_key(robot_id, names.STATUS), RobotStatus)

    def tell(self, *, logged: bool = True) -> None:
        """Publish the state if it is another one than before; also log it, unless the caller has."""
        now = self.readiness.state, self.readiness.reason
        if now == self._told:
            return
        state, reason = now
        if logged and reason and reason != self._told[1]:
            log.info("%s: %s", RobotState.TEXT[state], reason)
        self._told = now
        self.publish()

    def publish(self) -> None:
        """Publish the state."""
        readiness, command = self.readiness, self.command
        self._publisher.put(
            RobotStatus(
                header=Header(time_from_ns(self._node.clock.now()), names.robot_name(self._id)),
                robot_id=self._id,
                is_ready=readiness.is_ready,
                state=readiness.state,
                epoch=readiness.epoch,
                text=readiness.reason,
                behavior=self.behavior,
                driver=RobotDriver.NONE if command is None else RobotDriver.BEHAVIOR,
                reason=self._why_it_stands(),
                leader=-1 if self.leader is None else self.leader,
                speed=0.0 if command is None else command.linear.x,
            )
        )

    def _why_it_stands(self) -> str:
        command, reason = self.command, self.readiness.reason
        if command is None:
            return reason
        if command.linear.x:
            return ""
        return reason or ("" if command.angular.z else _IDLE)
