"""How a robot keeps to a path (pure pursuit), and the behaviour `path`."""

import math
from typing import Annotated

from msgspec import Meta, Struct

from zteam.config.numbers import Coordinate
from zteam.config.problems import KeyValueError
from zteam.geometry import Pose2
from zteam.kernels.polylines import Polyline
from zteam.messages import Twist, Vector3
from zteam.robot.behaviors.behavior import Behavior
from zteam.robot.view import NO_POSE, View, own_pose

LOOK_AHEAD = 0.3
"""Metres along the path from the robot to the point that it drives to."""


class SpeedLimits(Struct, frozen=True):
    """What limits a robot on a path."""

    linear: float = math.inf
    """m/s."""
    angular: float = math.pi
    """rad/s, both ways."""
    lateral: float = math.inf
    """m/s²: acceleration to the side. It slows down in a bend so far."""

    def clamp_turn(self, rate: float) -> float:
        """`rate` (rad/s) within the limit."""
        return max(-self.angular, min(self.angular, rate))


def pursue(
    pose: Pose2, path: Polyline, s: float, speed: float, limits: SpeedLimits, look_ahead: float = LOOK_AHEAD
) -> Twist:
    """The velocity of a robot at `pose` that keeps to `path` at `speed` (m/s, not negative) from its place `s` on.

    It slows down where the arc is too narrow for that speed, and it turns on the spot where the path leads to the side
    or back. At the end of the path it drives straight on: give a speed of 0 there. Raises IndexError without a path.
    """
    linear, turn = path.pursue(pose, s, look_ahead, speed, (limits.linear, limits.angular, limits.lateral))
    return Twist(Vector3(linear), Vector3(z=turn))


LATERAL = 0.5
"""m/s²: acceleration to the side in a bend."""
AHEAD = 0.25
"""Metres along the path: less would swing at 10 steps a second, more cuts the corners."""
BRAKING_GAIN = 1.5
"""1/s: it slows down before the end of the path."""
_APART = 0.01
"""Metres from the first waypoint to another one, at least: laps of no length never fill the window."""
_WINDOW = 0.5
"""Metres ahead of its place on the path within which the next one is looked for: a path may cross itself."""


class PathParams(Struct, frozen=True, forbid_unknown_fields=True):
    """Parameters of `path`; only the waypoints have to be given."""

    waypoints: Annotated[
        tuple[tuple[Coordinate, Coordinate], ...],
        Meta(min_length=2, description="m; [[x, y], [x, y], …] in map, at least two"),
    ]
    speed: Annotated[float, Meta(ge=0.0, le=1.0, description="m/s")] = 0.5
    loop: Annotated[bool, Meta(description="from the last waypoint on to the first, and round again")] = False
    max_angular: Annotated[float, Meta(ge=0.1, le=math.pi, description="rad/s")] = 1.5
    xy_goal_tolerance: Annotated[
        float, Meta(ge=0.02, le=100.0, description="m to the last waypoint, within which the path is at its end")
    ] = 0.05

    def __post_init__(self) -> None:
        if all(math.dist(place, self.waypoints[0]) < _APART for place in self.waypoints):
            raise KeyValueError("waypoints", f"must be at least two places, {_APART:g} m apart")


class FollowPath(Behavior):
    """Drive along waypoints in map, from the nearest place of their path on, once or round and round."""

    Params = PathParams
    params: PathParams
    uses_tf = True

    def __init__(self, params: PathParams) -> None:
        super().__init__(params)
        self.on_params()

    def on_params(self) -> None:
        """Begin anew from the nearest place if the waypoints are others."""
        waypoints = self.params.waypoints, self.params.loop
        if getattr(self, "_given", None) == waypoints:
            return
        self._given = waypoints
        self._path = Polyline(self.params.waypoints)
        self._place: float | None = None
        """Where it is on the path; None before its first step."""
        self._is_done = False
        if self.params.loop:
            self._add_lap()

    def step(self, view: View) -> Twist:
        """Along the path; zero at its end and while the own pose is not known."""
        own, path = own_pose(view), self._path
        if own is None:
            self.reason = NO_POSE
            return Twist()
        place = self._place = self._find_place(own)
        if self.params.loop:
            path.drop_before(place)
            while path.end < place + _WINDOW + AHEAD:
                self._add_lap()
            left = math.inf
        else:
            left = max(path.end - place, math.dist(own[:2], path.point(path.end)))
            self._is_done = self._is_done or left <= self.params.xy_goal_tolerance
        if self._is_done:
            self.reason = "end of the path"
            return Twist()
        self.reason = ""
        speed = min(self.params.speed, BRAKING_GAIN * left)
        return pursue(own, path, place, speed, SpeedLimits(angular=self.params.max_angular, lateral=LATERAL), AHEAD)

    def why_it_rests(self) -> str:
        return "its path leads to where it stands" if self.params.speed else "its parameter speed is 0"

    def _find_place(self, own: Pose2) -> float:
        """The nearest place: of the whole path at first, then a little ahead. It never goes back."""
        path, last = self._path, self._place
        window = (last, last + _WINDOW) if last is not None else ()
        place = path.near(own, *window)[0]
        # Where the path turns back on itself the point to drive to would be where the robot is.
        while place + AHEAD < path.end and math.dist(own[:2], path.point(place + AHEAD)) < 0.5 * AHEAD:
            place += 0.5 * AHEAD
        return place

    def _add_lap(self) -> None:
        """From the last waypoint on to the first, and round to the last."""
        for x, y in self.params.waypoints:
            self._path.append(x, y)
