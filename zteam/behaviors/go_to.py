"""Drive to a goal by the laser alone."""

import math
from collections.abc import Mapping
from typing import Annotated, ClassVar

from msgspec import Meta, Struct

from zteam import names
from zteam.behaviors.behavior import Behavior
from zteam.behaviors.boundary import Boundary, meet
from zteam.behaviors.escape import Escape
from zteam.behaviors.goals import read_goal
from zteam.behaviors.view import View
from zteam.geometry import Pose2, normalize_angle
from zteam.messages import LaserScan, Message, PoseStamped, Twist, Vector3

ANGULAR_GAIN = 2.0
"""1/s."""
LINEAR_GAIN = 1.0
"""1/s: it slows down in the last metre."""
LEAST_SPEED = 0.1
"""m/s, up to the edge of the tolerance."""
SPOT_ANGLE = 1.0
"""Radians: it turns on the spot towards a heading that is further off."""
BEHIND = 0.5 * math.pi
"""Radians: towards a heading that is further off it keeps the side to which it turns."""
SIDE_MARGIN = 0.015
"""Metres on either side of the circle that the base's corners describe when it turns."""
GOAL_REACHED = "goal reached"
BOXED_IN = "boxed in: it finds no way that is wide enough"
NO_WAY = "no way to the goal found: it went all round what stands between"


class GoToParams(Struct, frozen=True, forbid_unknown_fields=True):
    """Parameters of `go_to`."""

    speed: Annotated[float, Meta(ge=0.0, le=1.0, description="m/s")] = 0.4
    max_angular: Annotated[float, Meta(ge=0.1, le=math.pi, description="rad/s")] = 1.0
    xy_goal_tolerance: Annotated[
        float, Meta(ge=0.02, le=100.0, description="m to the goal, within which it is reached")
    ] = 0.25
    yaw_goal_tolerance: Annotated[
        float, Meta(ge=0.01, le=math.pi, description="rad; it turns there until its heading is as near to the goal's")
    ] = 0.25


class GoTo(Behavior):
    """Head for the newest goal on `robot_N/goal_pose`, and go round what stands between by the laser alone.

    It follows what stands in the way until leaving it leads nearer to the goal than it has been. It knows no map: in a
    building that has one, navigation finds shorter ways.
    """

    Params = GoToParams
    params: GoToParams
    uses_tf = True
    inputs: ClassVar[Mapping[str, tuple[str, type[Message]]]] = {"goal": (names.GOAL_POSE, PoseStamped)}

    def __init__(self, params: GoToParams) -> None:
        super().__init__(params)
        self._message: PoseStamped | None = None
        """The goal that was read last."""
        self._goal: Pose2 | None = None
        """In map."""
        self._refusal = "no goal yet"
        """Why there is no goal."""
        self._is_there = False
        """Whether it has been within the tolerance; then it only turns."""
        self._boundary: Boundary | None = None
        """What it goes round."""
        self._turn = 0.0
        """Radians that it had to turn at the last step, left positive."""
        self._spun = 0.0
        """Radians that it was to turn since it last drove."""
        self._escape = Escape()

    def step(self, view: View) -> Twist:
        """Towards the goal or along what stands between; zero without a goal and at the goal."""
        message = view.inputs.get("goal")
        if message is not None and message is not self._message:
            self._take(message, view)
        if self._goal is None:
            self.reason = self._refusal
            return Twist()
        found = view.map_from_base()
        if found is None or not all(map(math.isfinite, found[0])):
            self.reason = f"its own pose in {names.MAP_FRAME} is not known"
            return Twist()
        own = found[0]
        goal = own.inverse().compose(self._goal)
        distance = math.hypot(goal.x, goal.y)
        self._is_there = self._is_there or distance <= self.params.xy_goal_tolerance
        if self._is_there:
            return self._escape.free(view, self._turn_to(goal.yaw))
        heading = self._way(view, own, math.atan2(goal.y, goal.x), distance)
        if heading is None:
            return Twist()
        command = self._drive(heading, distance)
        self._spun = 0.0 if command.linear.x else self._spun + abs(command.angular.z) * view.dt
        return self._escape.free(view, command)

    def why_it_rests(self) -> str:
        """It drives or turns unless it is told not to."""
        return "its parameter speed is 0"

    def _take(self, message: PoseStamped, view: View) -> None:
        """A goal has come. One that is repeated changes nothing on the way; it counts anew at the goal."""
        goal, self._refusal = read_goal(message, view)
        self._message = message
        if goal != self._goal or self._is_there:
            self._is_there, self._boundary = False, None
        self._goal = goal

    def _turn_to(self, yaw: float) -> Twist:
        if abs(yaw) <= self.params.yaw_goal_tolerance:
            self.reason = GOAL_REACHED
            return Twist()
        self.reason = ""
        return Twist(angular=Vector3(z=self._turn_rate(yaw)))

    def _way(self, view: View, own: Pose2, bearing: float, distance: float) -> float | None:
        """The heading to take (rad), or None where there is none; `reason` says why."""
        self.reason = ""
        scan = view.scan
        if scan is None:
            self.reason = "no scan yet"
            return None
        half_width = view.base.radius + SIDE_MARGIN
        boundary = self._boundary
        if boundary is None or boundary.may_leave(scan, half_width, bearing, distance, own):
            boundary = self._boundary = meet(scan, half_width, bearing, distance, own)
        if boundary is None:
            return bearing
        return self._follow(boundary, scan, half_width, own)

    def _follow(self, boundary: Boundary, scan: LaserScan, half_width: float, own: Pose2) -> float | None:
        if boundary.is_closed:
            self.reason = NO_WAY
            return None
        # What the laser does not see, behind it, looks clear again and again.
        self.reason = BOXED_IN if self._spun > math.tau else ""
        heading = boundary.heading(scan, half_width, own)
        # Without any clear heading it turns away from the obstacle until there is one.
        return boundary.side * math.pi if heading is None else heading

    def _drive(self, heading: float, distance: float) -> Twist:
        straight = max(0.0, 1.0 - abs(normalize_angle(heading)) / SPOT_ANGLE)
        speed = min(self.params.speed, max(LINEAR_GAIN * distance, LEAST_SPEED)) * straight
        return Twist(Vector3(speed), Vector3(z=self._turn_rate(heading)))

    def _turn_rate(self, angle: float) -> float:
        """Rad/s towards a heading. What is behind may be now a little to the left and now to the right."""
        angle = normalize_angle(angle)
        if abs(angle) > BEHIND and angle * self._turn < 0.0:
            angle += math.copysign(math.tau, self._turn)
        self._turn = angle
        return max(-self.params.max_angular, min(self.params.max_angular, ANGULAR_GAIN * angle))
