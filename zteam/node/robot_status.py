"""A robot's side of the start gate, and what it says of itself: at 1 Hz and when its state or its text changes.

Behaviours may listen to the status. So in lock-step it is made in the robot's steps alone, and what the host's clock or
other processes ask for meanwhile is the last one again.
"""

from collections.abc import Sequence
from typing import Protocol

import msgspec

from zteam import messages, names
from zteam.bus import Publisher
from zteam.clock import Every, to_ns
from zteam.errors import log
from zteam.node.process_node import ProcessNode
from zteam.node.stopping import STOPPED, StopSwitch
from zteam.reasons import Reason

_MONITORS = 0.1
"""Host seconds between two statuses for monitors that have just come: any program may hold tokens."""
PERIOD = to_ns(1.0)
"""Simulated nanoseconds between two statuses of a robot in lock-step."""
REST = to_ns(5.0)
"""Nanoseconds for which a reason has to be gone until it is printed again."""
_NOBODY = -1, -1
"""`waits_for` and `blocked_by` of a reason that is no Reason."""
_MOST = 4
"""Reasons that are printed within REST: one that has a number in it may be another one in each step."""


def go_epoch(team: messages.TeamStatus | None, now: int) -> int:
    """The GO that holds at time `now` (ns) by the monitor's newest word; 0 = none yet."""
    if team is None or team.state != messages.TeamState.GO or now < messages.ns_from_time(team.go_stamp):
        return 0
    return team.epoch


class Readiness:
    """The state of one robot, and the reason: BOOT until it has all its data, READY until GO, then RUNNING for good."""

    def __init__(self, *, gated: bool, way_out: str = "") -> None:
        """Without `gated` the robot drives at once. `way_out` is what a user may do while the robot waits for GO."""
        self._way_out = f" ({way_out})" if way_out else ""
        self.released = not gated
        """Whether the robot may drive."""
        self.state: int = messages.RobotState.BOOT
        self.reason = ""
        """Why it is in this state; empty if there is nothing to say."""
        self.epoch = 0
        """The GO that the robot obeys; 0 = none."""

    @property
    def is_ready(self) -> bool:
        """What the robot tells the monitor."""
        return self.state in (messages.RobotState.READY, messages.RobotState.RUNNING)

    def take(self, missing: Sequence[str], epoch: int) -> bool:
        """Take what the robot lacks and the GO that holds (0 = none); whether the robot may drive now."""
        if self.released:
            self.epoch = max(epoch, self.epoch)
        elif missing:
            self.state, self.reason = messages.RobotState.BOOT, "waiting for " + ", ".join(missing)
        elif not epoch:
            self.state = messages.RobotState.READY
            self.reason = f"waiting for the monitor's GO{self._way_out}"
        else:
            self.released, self.epoch = True, epoch
        return self.released

    def drive(self, reason: str, epoch: int = 0) -> None:
        """The robot acts; `reason` says why it stands still, if it does; `epoch` is the GO that holds (0 = none)."""
        self.state, self.reason, self.epoch = messages.RobotState.RUNNING, reason, max(epoch, self.epoch)

    def stop(self) -> None:
        self.state, self.reason = messages.RobotState.STOPPED, "stopped"


class StatusSource(Protocol):
    """What a status tells of what drives the robot: a behaviour has it."""

    leader: int | None = None
    follows: int | None = None
    gap: float = 0.0
    turns: int = -1
    navigation: messages.NavigationStatus | None = None

    def why_it_rests(self) -> str:
        """Why it wants zero velocity; empty = no word."""
        return ""


class OwnStep(StatusSource):
    """The step of a `zteam.Node`, which has no place in a line, no goal, and gives no reason."""


class ReasonLog:
    """A reason is printed once until it changes, and not again and again while two of them take turns."""

    def __init__(self) -> None:
        self._logged: dict[str, int] = {}
        """By reason: when it held last."""

    def admit(self, reason: str, now: int, *, is_known: bool = False) -> bool:
        """Whether to print a reason that holds at time `now` (ns); not if it `is_known` to the reader already."""
        if not reason:
            return False
        logged = self._logged = {each: held for each, held in self._logged.items() if abs(now - held) < REST}
        if reason not in logged and len(logged) >= _MOST:
            return False
        is_new = reason not in logged
        logged[reason] = now
        return is_new and not is_known


class StatusReport:
    """Publishes the status of robot `robot_id`. The caller holds `node.changed`."""

    def __init__(
        self,
        node: ProcessNode,
        robot_id: int,
        behavior: str,
        readiness: Readiness,
        stop: StopSwitch,
        *,
        safety: bool = True,
    ) -> None:
        """`behavior` is what the robot was started with, such as `follow` or `my_robot:Turner`.

        `stop`: whether the robot is stopped. Without `safety` each status says that there is no safety layer.
        """
        self._node, self._id, self._stop = node, robot_id, stop
        self.behavior, self.readiness = behavior, readiness
        self._warning = "" if safety else "no safety layer"
        self.tells_of: StatusSource = OwnStep()
        """Whose place in a line, goal and rest it tells."""
        self.command: messages.Twist | None = None
        """The newest command; None while nothing commands the wheels."""
        self.driver = messages.RobotDriver.NONE
        """What gave it, of RobotDriver."""
        self._navigation_publisher: Publisher[messages.NavigationStatus] | None = None
        self._told = self._state()
        self._reasons = ReasonLog()
        self._last: messages.RobotStatus | None = None
        self._publisher = node.bus.publisher(names.robot_key(robot_id, names.STATUS), messages.RobotStatus)
        self._may_tell = Every(_MONITORS)
        node.on_time_reset(self._forget)
        node.watch_tokens(names.tokens_key(names.MONITOR), self._on_monitor)

    def _on_monitor(self, _key: str, alive: bool) -> None:
        if alive and self._may_tell.due():
            # A monitor that has just come must not wait for the next heartbeat to know this robot.
            self.say_again()

    def _state(self) -> tuple[int, str, tuple[object, ...]]:
        behavior, told, reason = self.tells_of, self.tells_of.navigation, self.readiness.reason
        goal = told and (told.state, told.text, told.goal)
        others = (reason.waits_for, reason.blocked_by) if isinstance(reason, Reason) else _NOBODY
        stands = self.driver, self._stop.is_stopped, behavior.follows, behavior.turns, goal, others
        return self.readiness.state, reason, stands

    def tell(self, *, logged: bool = True) -> None:
        """Publish the state if it is another one than before; also log the reason, unless the caller has."""
        state, reason = self.readiness.state, self.readiness.reason
        # In each step: the reason that holds on and on is not a new one when it has been gone for a moment.
        if self._reasons.admit(reason, self._node.clock.now(), is_known=not logged):
            told = "" if state == messages.RobotState.RUNNING else f"{messages.RobotState.TEXT[state]}: "
            log.info("%s%s", told, reason)
        self.publish_change()

    def publish_change(self) -> None:
        """Publish the state if it is another one than before."""
        now = self._state()
        if now != self._told:
            self._told = now
            self.publish()

    def keep_up(self, now: int) -> None:
        """In a step of lock-step at time `now` (ns): publish the state if that was not done in this PERIOD.

        All robots do so in the same tick, and in the others their listeners have nothing to take in.
        """
        if self._last is None or now // PERIOD > messages.ns_from_time(self._last.header.stamp) // PERIOD:
            self.publish()

    def say_again(self) -> None:
        """Publish the status at a moment of the host."""
        if not self._node.can_publish:
            # The word of a process that does not hold the name would count for the one that does.
            return
        # In lock-step its steps alone may tell anything new.
        if not (self.readiness.released and self._node.ticks_tell_time):
            self.publish()
        elif self._last is not None:
            self._publisher.put(self._last)

    def stop(self) -> None:
        self.readiness.stop()
        self.driver, self.command = messages.RobotDriver.NONE, None
        self.publish()

    def _forget(self) -> None:
        """Time jumped back: the next step makes a new one. The last one would be of the future."""
        self._last = None

    def publish(self) -> None:
        is_stopped = self._stop.is_stopped
        readiness, command, behavior = self.readiness, self.command, self.tells_of
        reason = Reason.of(self._why_it_stands())
        self._last = messages.RobotStatus(
            header=messages.Header(messages.time_from_ns(self._node.clock.now()), names.robot_name(self._id)),
            robot_id=self._id,
            is_ready=readiness.is_ready,
            state=readiness.state,
            epoch=readiness.epoch,
            text="; ".join(filter(None, (self._warning, readiness.reason))),
            behavior=self.behavior,
            driver=self.driver,
            reason=str(reason),
            leader=-1 if behavior.leader is None else behavior.leader,
            speed=0.0 if command is None or is_stopped else command.linear.x,
            follows=-1 if behavior.follows is None else behavior.follows,
            turns=behavior.turns,
            gap=behavior.gap,
            is_stopped=is_stopped,
            waits_for=reason.waits_for,
            blocked_by=reason.blocked_by,
            goal_state=messages.NavigationState.IDLE if behavior.navigation is None else behavior.navigation.state,
        )
        self._publisher.put(self._last)
        if behavior.navigation is not None:
            self._publish_navigation(behavior.navigation, self._last)

    def _publish_navigation(self, told: messages.NavigationStatus, status: messages.RobotStatus) -> None:
        key = names.robot_key(self._id, names.NAVIGATION_STATUS)
        publisher = self._navigation_publisher = self._navigation_publisher or self._node.bus.publisher(
            key, messages.NavigationStatus
        )
        # What else keeps the robot from its goal, such as its safety layer.
        text = status.reason if told.state == messages.NavigationState.DRIVING and not told.text else told.text
        # The header's frame tells a behaviour from navigation.
        publisher.put(msgspec.structs.replace(told, header=status.header, text=text))

    def _why_it_stands(self) -> str:
        command, reason = self.command, self.readiness.reason
        if self._stop.is_stopped:
            return STOPPED
        if command is None:
            return reason
        if command.linear.x or command.linear.y:
            return ""
        if reason or command.angular.z:
            return reason
        if self.driver != messages.RobotDriver.BEHAVIOR:
            return f"{self.driver} commands zero velocity"
        return self.tells_of.why_it_rests() or "the behaviour commands zero velocity"
