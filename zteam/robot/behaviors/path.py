"""A path of straight pieces by arc length, how a robot keeps to it (pure pursuit), and the behaviour `path`."""

import math
from bisect import bisect_right
from collections.abc import Iterable, Sequence
from typing import Annotated

from msgspec import Meta, Struct

from zteam.config.problems import KeyValueError
from zteam.geometry import FAR, Pose2, curvature_to
from zteam.messages import Twist, Vector3
from zteam.robot.behaviors.behavior import Behavior
from zteam.robot.view import NO_POSE, View, own_pose

_LEAST = 1e-9
"""Metres: a nearer point is the same point, because its direction would be rounding."""


class Polyline:
    """Points joined by straight pieces. It grows at its end and can be dropped from its beginning.

    Places on it are arc lengths from its first point, in metres. They stay the same when its beginning is dropped.
    """

    def __init__(self, points: Iterable[tuple[float, float]] = ()) -> None:
        self._points: list[tuple[float, float]] = []
        self._s: list[float] = []
        """The place of each point."""
        self.start = 0.0
        """The place of its beginning: above 0 once something was dropped."""
        self.end = 0.0
        """The place of its last point."""
        for x, y in points:
            self.append(x, y)

    def __len__(self) -> int:
        return len(self._s)

    @property
    def last(self) -> tuple[float, float]:
        """Its last point. Raises IndexError without one."""
        return self._points[-1]

    def append(self, x: float, y: float) -> None:
        if self._s:
            step = math.hypot(x - self.last[0], y - self.last[1])
            if step < _LEAST:
                return
            self.end += step
        self._points.append((x, y))
        self._s.append(self.end)

    def drop_before(self, s: float) -> None:
        """Forget what lies before `s`, but for the last piece."""
        self.start = max(self.start, min(s, self.end))
        count = self._piece(self.start)
        del self._points[:count], self._s[:count]

    def cut_after(self, s: float) -> None:
        """Forget what lies behind `s`, which becomes its end."""
        if not self._s or s >= self.end:
            return
        x, y = self.point(s)
        keep = max(1, bisect_right(self._s, max(s, self.start)))
        del self._points[keep:], self._s[keep:]
        self.end = self._s[-1]
        self.append(x, y)

    def at(self, s: float) -> Pose2:
        """The point at `s`, or the end nearest to it, and the direction there. Raises IndexError without a point."""
        if len(self._s) < 2:
            return Pose2(*self._points[0], 0.0)
        s = min(max(s, self.start), self.end)
        piece = self._piece(s)
        (ax, ay), (bx, by) = self._points[piece : piece + 2]
        return Pose2(*self._point(piece, s), math.atan2(by - ay, bx - ax))

    def point(self, s: float) -> tuple[float, float]:
        """The point at `s`, as `at`. Raises IndexError without a point."""
        return self.at(s)[:2]

    def project(self, x: float, y: float, low: float = -math.inf, high: float = math.inf) -> float:
        """The place from `low` to `high` nearest to a point, the first of equal ones. Raises IndexError if empty."""
        points, places = self._points, self._s
        low = min(max(low, self.start), self.end)
        high = min(max(high, low), self.end)
        if len(places) < 2:
            return places[0]
        first, last = self._piece(low), self._piece(high)
        (from_x, from_y), to = self._point(first, low), self._point(last, high)
        first, last = first + 1, last + 1
        begin, best, nearest = low, low, math.inf
        for (to_x, to_y), end in zip((*points[first:last], to), (*places[first:last], high), strict=True):
            ex, ey = to_x - from_x, to_y - from_y
            off_x, off_y = x - from_x, y - from_y
            along, square, share = off_x * ex + off_y * ey, ex * ex + ey * ey, 0.0
            if along > 0.0:
                share = along / square if along < square else 1.0
                off_x, off_y = off_x - share * ex, off_y - share * ey
            off = off_x * off_x + off_y * off_y
            if off < nearest:
                nearest, best = off, begin + share * (end - begin)
            from_x, from_y, begin = to_x, to_y, end
        return best

    def near(self, point: Sequence[float], low: float = -math.inf, high: float = math.inf) -> tuple[float, float]:
        """The place of `project` for (x, y), and the metres from there to it."""
        place = self.project(point[0], point[1], low, high)
        return place, math.dist(point[:2], self.point(place))

    def _point(self, piece: int, s: float) -> tuple[float, float]:
        """The point at `s`, which lies on this piece: as `at`."""
        (x, y), (to_x, to_y) = self._points[piece : piece + 2]
        share = (s - self._s[piece]) / (self._s[piece + 1] - self._s[piece])
        return x + share * (to_x - x), y + share * (to_y - y)

    def _piece(self, s: float) -> int:
        """The index of the point at which the piece around `s` begins."""
        return max(0, min(bisect_right(self._s, s) - 1, len(self._s) - 2))


LOOK_AHEAD = 0.3
"""Metres along the path from the robot to the point that it drives to."""
TURN_ON_THE_SPOT = 1.0
"""Radians: it turns on the spot while the point is further to the side."""
TURN_GAIN = 4.0
"""1/s: the turn on the spot, by the angle that is left."""
_NEAR = 0.02
"""Metres: a nearer point tells no direction."""


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
    target_x, target_y, yaw = path.at(s + look_ahead)
    beyond = s + look_ahead - path.end
    if beyond > 0.0:
        target_x, target_y = target_x + beyond * math.cos(yaw), target_y + beyond * math.sin(yaw)
    x, y = pose.locate(target_x, target_y)
    square = x * x + y * y
    if square < _NEAR * _NEAR and beyond < 0.0:
        # The path goes on, back past this place.
        return pursue(pose, path, s, speed, limits, 2.0 * look_ahead)
    if square < _NEAR * _NEAR or speed <= 0.0:
        return Twist()
    angle = math.atan2(y, x)
    if abs(angle) > TURN_ON_THE_SPOT:
        return Twist(angular=Vector3(z=limits.clamp_turn(TURN_GAIN * angle)))
    curvature = curvature_to(y, square)
    speed = slow_down(speed, curvature, limits)
    return Twist(linear=Vector3(x=speed), angular=Vector3(z=speed * curvature))


def slow_down(speed: float, curvature: float, limits: SpeedLimits) -> float:
    """The largest speed (m/s) up to `speed` with which a robot may drive an arc of this curvature (1/m)."""
    bend = abs(curvature)
    speed = min(speed, limits.linear)
    if speed * bend > limits.angular:
        speed = limits.angular / bend
    return math.sqrt(limits.lateral / bend) if speed * speed * bend > limits.lateral else speed


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

Coordinate = Annotated[float, Meta(ge=-FAR, le=FAR)]


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
        return "its parameter speed is 0" if not self.params.speed else "its path leads to where it stands"

    def _find_place(self, own: Pose2) -> float:
        """The nearest place: of the whole path at first, then a little ahead. It never goes back."""
        path, last = self._path, self._place
        window = (last, last + _WINDOW) if last is not None else ()
        place = path.project(own.x, own.y, *window)
        # Where the path turns back on itself the point to drive to would be where the robot is.
        while place + AHEAD < path.end and math.dist(own[:2], path.point(place + AHEAD)) < 0.5 * AHEAD:
            place += 0.5 * AHEAD
        return place

    def _add_lap(self) -> None:
        """From the last waypoint on to the first, and round to the last."""
        for x, y in self.params.waypoints:
            self._path.append(x, y)
