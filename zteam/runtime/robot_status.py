"""What the robot says of itself: published at 1 Hz and when its state or its text changes, and logged.

Behaviours may listen to it. So in lock-step it is made in the robot's steps alone, and what the host's clock or other
processes ask for meanwhile is the last one again.
"""

import logging
from collections.abc import Callable

from zteam import names
from zteam.clock import to_ns
from zteam.messages import Header, RobotDriver, RobotState, RobotStatus, Twist, time_from_ns
from zteam.runtime.node import Node
from zteam.runtime.readiness import Readiness

log = logging.getLogger("zteam")

PERIOD = to_ns(1.0)
"""Simulated nanoseconds between two statuses of a robot in lock-step."""
NO_SAFETY = "no safety layer"

_WHO = {RobotDriver.BEHAVIOR: "the behaviour"}
"""What the reason calls a driver; the others have their own names."""


class StatusReport:
    """Publishes the status of robot `robot_id`. The caller holds `node.changed`."""

    def __init__(self, node: Node, robot_id: int, behavior: str, readiness: Readiness, *, safety: bool = True) -> None:
        """`behavior` is what the robot was started with, such as `follow` or `my_robot:Turner`.

        Without `safety` each status says that there is no safety layer.
        """
        self._warning = "" if safety else NO_SAFETY
        self._node = node
        self._id = robot_id
        self.behavior = behavior
        self.readiness = readiness
        self.leader: int | None = None
        self.follows: int | None = None
        self.turns, self.gap = -1, 0.0
        self.command: Twist | None = None
        """The newest command; None while nothing commands the wheels."""
        self._driver = RobotDriver.BEHAVIOR
        """What gave it."""
        self._told = self._state()
        self._last: RobotStatus | None = None
        """The newest one that was made."""
        self._made = 0
        """When, in ns."""
        self._spoke = False
        """Whether one was published since `take_spoken` was asked last."""
        self.rest: Callable[[], str] = lambda: ""
        """Why the behaviour wants zero velocity, if it has a word for that."""
        self._publisher = node.bus.publisher(names.robot_key(robot_id, names.STATUS), RobotStatus)
        node.on_time_reset(self._forget)

    def take(self, driver: str, command: Twist) -> None:
        """The newest command, which `driver` (of RobotDriver) gave."""
        self._driver, self.command = driver, command

    def _state(self) -> tuple[int, str, str, int | None, int]:
        return self.readiness.state, self.readiness.reason, self.driver, self.follows, self.turns

    @property
    def driver(self) -> str:
        """What commands the wheels, of RobotDriver."""
        return RobotDriver.NONE if self.command is None else self._driver

    def tell(self, *, logged: bool = True) -> None:
        """Publish the state if it is another one than before; also log it, unless the caller has."""
        now = self._state()
        if now == self._told:
            return
        state, reason = now[:2]
        if logged and reason and reason != self._told[1]:
            log.info("%s: %s", RobotState.TEXT[state], reason)
        self._told = now
        self.publish()

    def keep_up(self, now: int) -> None:
        """In a step of lock-step at time `now` (ns): publish the state if that was not done in this PERIOD.

        All robots do so in the same tick, and in the others their listeners have nothing to take in.
        """
        if self._last is None or now // PERIOD > self._made // PERIOD:
            self.publish()

    def repeat(self) -> None:
        """Publish the last one again, if there is one: for a process that lacks it, or as a sign of life."""
        if self._last is not None:
            self._publisher.put(self._last)

    def take_spoken(self) -> bool:
        """Whether one was published since this was asked last: then other processes have a sign of life."""
        spoke, self._spoke = self._spoke, False
        return spoke

    def _forget(self) -> None:
        """Time jumped back: the next step makes a new one. The last one would be of the future."""
        self._last = None

    def publish(self) -> None:
        """Publish the state."""
        self._spoke = True
        readiness, command = self.readiness, self.command
        self._made = self._node.clock.now()
        self._last = RobotStatus(
            header=Header(time_from_ns(self._made), names.robot_name(self._id)),
            robot_id=self._id,
            is_ready=readiness.is_ready,
            state=readiness.state,
            epoch=readiness.epoch,
            text="; ".join(filter(None, (self._warning, readiness.reason))),
            behavior=self.behavior,
            driver=self.driver,
            reason=self._why_it_stands(),
            leader=-1 if self.leader is None else self.leader,
            speed=0.0 if command is None else command.linear.x,
            follows=-1 if self.follows is None else self.follows,
            turns=self.turns,
            gap=self.gap,
        )
        self._publisher.put(self._last)

    def _why_it_stands(self) -> str:
        command, reason = self.command, self.readiness.reason
        if command is None:
            return reason
        if command.linear.x:
            return ""
        if reason or command.angular.z:
            return reason
        rest = self.rest() if self._driver == RobotDriver.BEHAVIOR else ""
        return rest or f"{_WHO.get(self._driver, self._driver)} commands zero velocity"
