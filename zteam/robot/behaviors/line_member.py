"""What `follow` and `wander` share: a robot of a line, which follows along the trail of its head, or leads."""

import logging
from collections.abc import Mapping
from typing import Any, ClassVar

from zteam.geometry import Pose2
from zteam.messages import Message, Twist
from zteam.robot.behaviors.behavior import Behavior
from zteam.robot.behaviors.line import NO_TURNS, STATUSES, Line, LineRole, OnLeaderLost, waits_for
from zteam.robot.behaviors.line_room import Head
from zteam.robot.behaviors.trail import Trail
from zteam.robot.view import NO_POSE, SILENT_AFTER, View, own_pose

log = logging.getLogger("zteam")


def find_silent(view: View, role: LineRole) -> int | None:
    """A robot of the line that is silent, or a neighbour or head whose pose is old; None without one."""
    for robot in (*role.before, *role.after):
        if robot in view.silent:
            return robot
    for robot in {*role.before[:1], *role.before[-1:], *role.after[:1]}:
        seen = view.base_from_robot(robot)
        if seen is not None and seen[1] and not view.is_fresh(seen[1], SILENT_AFTER):
            return robot
    return None


class LineMember(Behavior):
    """A robot that may be in a line. A subclass sets `turns` to NO_TURNS if it cannot follow the robot behind it."""

    inputs: ClassVar[Mapping[str, tuple[str, type[Message]]]] = STATUSES

    def __init__(self, params: Any) -> None:
        super().__init__(params)
        self._line, self._trail, self._head = Line(), Trail(), Head()
        self._silent: int | None = None
        """A robot of its line that is silent, or whose pose is old."""
        self.on_params()

    def on_release(self) -> None:
        """See Behavior: that it did not get on meanwhile is no reason to hand over or to leave its way."""
        self._trail.rest()
        self._head.rest()

    def _find_role(self, view: View, leader: int | None, on_lost: OnLeaderLost = "relink") -> LineRole:
        may_turn = self.turns != NO_TURNS
        role = self._line.find_role(view, leader, on_lost, may_turn=may_turn)
        self.turns = self._line.turns if may_turn else NO_TURNS
        self._silent = None
        return role

    def _locate(self, view: View, role: LineRole) -> Pose2 | None:
        """The own pose in map, which counts as a part of its way; None where the robot has to stand for a reason."""
        own = own_pose(view)
        self.reason = role.reason or (NO_POSE if own is None else "")
        if own is None or role.reason:
            return None
        self._silent = find_silent(view, role)
        if self._silent is not None:
            # That the line does not get on meanwhile is no reason for anything.
            self.on_release()
        self._trail.note(own)
        if role.ahead is not None:
            self._head.rest()
        return own

    def _lead(self, view: View, own: Pose2, role: LineRole, speed: float, turn_rate: float) -> Twist:
        """The velocity as the robot that leads; it hands over where it gets on no more."""
        if self._silent is not None:
            self.reason = waits_for(self._silent, "is silent")
            return Twist()
        command, self.reason = self._head.step(view, own, role, speed, turn_rate)
        if command is not None:
            return command
        self._head.rest()
        self._turn_line()
        self.reason = "hands over to the other end of the line"
        log.info("%s", self.reason)
        return Twist()

    def _turn_line(self) -> None:
        """The line is led from its other end from now on."""
        self._line.turn_on()
        self.turns = self._line.turns

    def why_it_rests(self) -> str:
        if self._silent is not None:
            return waits_for(self._silent, "is silent")
        if self.follows is None:
            return "it looks for a way to lead the line"
        return waits_for(self.follows, f"is {self._trail.ahead.apart:.1f} m away")
