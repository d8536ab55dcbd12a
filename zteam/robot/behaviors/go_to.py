"""Drive to a goal by the laser alone."""

import math
from collections.abc import Mapping
from typing import Annotated, ClassVar

from msgspec import Meta, Struct

from zteam import names
from zteam.geometry import Pose2, normalize_angle
from zteam.messages import Duration, LaserScan, Message, NavigationState, NavigationStatus, PoseStamped, Twist, Vector3
from zteam.messages.planar import goal_in_map
from zteam.robot.behaviors.behavior import Behavior
from zteam.robot.behaviors.escape import Escape
from zteam.robot.view import NO_POSE, View, first_clear, is_clear, is_seen, look_along, own_pose

REACH = 0.6
"""Metres ahead of the laser that have to be clear."""
ALONG = 0.75
"""The same on the way along an obstacle: so what was met stays in reach when the laser turns with the base."""
GAIN = 0.3
"""Metres nearer to the goal that leaving has to bring: less is soon lost again."""
_STEP = math.radians(10.0)
_AWAY = {side: tuple(side * step * _STEP for step in range(1, 28)) for side in (1.0, -1.0)}
"""Turns away from the obstacle, up to three quarters of a circle, by the side on which it goes round."""
_SQUARE = 0.5 * math.pi
_TOWARDS = 12
"""Headings that are tried towards the obstacle; where all are clear it is not seen."""
_GONE = 5
"""Steps without seeing it after which the obstacle is not there any more: a thin wall is not seen along its line."""
_ROUND = 1.2
"""Metres from where it met the obstacle to the place to come back to, and away from that before coming back counts."""
_BACK = 0.6
"""Metres from that place within which it is back."""
_ONWARD = 0.5
"""Cosine of the angle to the heading that it had there, from which on it is back."""
_DETOURS = tuple(side * step * _STEP for step in range(1, 13) for side in (1.0, -1.0))
"""Turns from the bearing, the least first; left before right."""


class Boundary:
    """Going round one obstacle, from where it was met on (DistBug, Kamon and Rivlin 1997).

    The robot keeps the obstacle on one side. It leaves where the way towards the goal is open and leads nearer to the
    goal than it has been since it met the obstacle. So each obstacle brings it nearer, and a dead end holds it only
    once. When it has gone all round the obstacle without such a place there is no way.
    """

    def __init__(self, own: Pose2, bearing: float, distance: float, side: float) -> None:
        """`bearing` and `distance`: of the goal. `side` is 1 with the obstacle on the right, -1 on the left."""
        self._mark = own
        """Where it met the obstacle, and then the place to come back to."""
        self._is_along = False
        self.side = side
        self._heading = own.yaw + bearing + side * _SQUARE
        """In map: the heading taken last; at first along what stands in the straight way."""
        self._least = distance
        self._was_away = False
        self.is_closed = False
        """Whether it has gone all round."""
        self._unseen = 0
        """Steps in a row in which it did not see the obstacle."""

    def heading(self, scan: LaserScan, half_width: float, own: Pose2) -> float | None:
        """The clear heading next to the obstacle (rad, in the base); None where no heading is clear.

        It looks from the side of the heading taken last on, where the obstacle is: so a door in a wall is not missed.
        """
        last = normalize_angle(self._heading - own.yaw)
        start = last - self.side * _SQUARE
        heading = first_clear(scan, half_width, ALONG, start, _AWAY[self.side])
        if heading == start:
            # The obstacle is narrow, or it ends: look for its edge from this side.
            heading = first_clear(scan, half_width, ALONG, last, _AWAY[self.side])
            if heading == last:
                heading = self._nearest_clear(scan, half_width, last)
        else:
            self._unseen = 0
        if heading is None:
            return None
        self._heading = own.yaw + heading
        return normalize_angle(heading)

    def _nearest_clear(self, scan: LaserScan, half_width: float, heading: float) -> float:
        """The last clear heading from a clear one towards the obstacle."""
        for reach in (ALONG, 2.0 * ALONG):
            for step in range(_TOWARDS):
                nearer = heading - self.side * (step + 1) * _STEP
                if not is_clear(scan, half_width, reach, nearer):
                    self._unseen = 0
                    return heading - self.side * step * _STEP
        self._unseen += 1
        return heading

    def may_leave(self, scan: LaserScan, half_width: float, bearing: float, distance: float, own: Pose2) -> bool:
        """Whether to head for the goal from here; called once a step."""
        if self._unseen >= _GONE:
            return True
        self._watch_for_closing(own)
        if not is_seen(scan, bearing):
            return False
        room = look_along(scan, half_width, bearing)
        left = distance - min(room, distance)
        if left <= self._least - GAIN and room >= min(ALONG, distance):
            return True
        self._least = min(self._least, left)
        return False

    def _watch_for_closing(self, own: Pose2) -> None:
        """It is all round when it comes back to a place that it passed in the same direction.

        The place is a little way along. Where it met the obstacle it may be a doorway, which it passes from both sides.
        """
        away = math.hypot(own.x - self._mark.x, own.y - self._mark.y)
        if away > _ROUND and not self._is_along:
            self._mark, self._is_along = own, True
            return
        self._was_away = self._was_away or (self._is_along and away > _ROUND)
        is_back = away < _BACK and math.cos(own.yaw - self._mark.yaw) > _ONWARD
        self.is_closed = self.is_closed or (self._was_away and is_back)


def meet(scan: LaserScan, half_width: float, bearing: float, distance: float, own: Pose2) -> Boundary | None:
    """The obstacle in the straight way to the goal, passed on the side of the lesser turn; None if it is clear."""
    reach = min(REACH, distance)
    heading = first_clear(scan, half_width, reach, bearing, _DETOURS)
    if heading == bearing:
        return None
    return Boundary(own, bearing, distance, -1.0 if heading is not None and heading < bearing else 1.0)


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
NO_GOAL = "no goal yet"
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
        self.navigation: NavigationStatus = NavigationStatus(text=NO_GOAL)
        """`distance_remaining` is as the crow flies, `estimated_time_remaining` at the parameter `speed`."""
        self.reason = NO_GOAL
        """It stays while there is no goal."""
        self._is_canceled = False
        """Whether the goal is to be given up."""
        self._goal: Pose2 | None = None
        """In map."""
        self._is_there = False
        """Whether it has been within the tolerance; then it only turns."""
        self._boundary: Boundary | None = None
        """What it goes round."""
        self._turn = self._spun = 0.0
        """Radians that it had to turn at the last step, left positive, and that it was to turn since it last drove."""
        self._escape = Escape()

    def step(self, view: View) -> Twist:
        """Towards the goal or along what stands between; zero without a goal and at the goal."""
        status, message = self.navigation, view.inputs.get("goal")
        if self._is_canceled:
            self._is_canceled, self._goal, self.reason = False, None, "its goal is canceled"
            status.state = NavigationState.CANCELED
        if message is not None and message is not status.goal:
            self._on_goal(message, view)
        command = Twist() if self._goal is None else self._head_for(view, self._goal)
        status.text = "" if status.state == NavigationState.SUCCEEDED else self.reason
        return command

    def on_release(self) -> None:
        """See Behavior: it was not boxed in."""
        self._spun = 0.0
        self._escape.rest()

    def why_it_rests(self) -> str:
        return "its parameter speed is 0"

    def cancel_goal(self) -> bool:
        self._is_canceled = self.navigation.state == NavigationState.DRIVING
        return self._is_canceled

    def _on_goal(self, message: PoseStamped, view: View) -> None:
        """One that is repeated changes nothing on the way; it counts anew at the goal."""
        found = goal_in_map(message, view.robot_id, view.lookup)
        goal, self.reason = (found, "") if isinstance(found, Pose2) else (None, found)
        self.navigation.goal, self.navigation.distance_remaining = message, 0.0
        if goal is None:
            self.navigation.state = NavigationState.ABORTED
        if goal != self._goal or self._is_there:
            self._is_there, self._boundary = False, None
        self._goal = goal

    def _head_for(self, view: View, target: Pose2) -> Twist:
        status, own = self.navigation, own_pose(view)
        status.state, self.reason = NavigationState.DRIVING, "" if own else NO_POSE
        if own is None:
            return Twist()
        goal = own.inverse().compose(target)
        distance = status.distance_remaining = math.hypot(goal.x, goal.y)
        seconds = distance / self.params.speed if self.params.speed else 0.0
        status.estimated_time_remaining = Duration(int(seconds), int(seconds % 1.0 * 1e9))
        self._is_there = self._is_there or distance <= self.params.xy_goal_tolerance
        if self._is_there:
            command = Twist(angular=Vector3(z=self._turn_rate(goal.yaw)))
            if abs(goal.yaw) <= self.params.yaw_goal_tolerance:
                status.state, self.reason, command = NavigationState.SUCCEEDED, GOAL_REACHED, Twist()
            return self._escape.free(view, command)
        heading = self._way(view, own, math.atan2(goal.y, goal.x), distance)
        if heading is None:
            return Twist()
        command = self._drive(heading, distance)
        self._spun = 0.0 if command.linear.x else self._spun + abs(command.angular.z) * view.dt
        return self._escape.free(view, command)

    def _way(self, view: View, own: Pose2, bearing: float, distance: float) -> float | None:
        """The heading to take (rad), or None where there is none; `reason` says why."""
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
        if boundary.is_closed:
            self.reason, self.navigation.state = NO_WAY, NavigationState.ABORTED
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
