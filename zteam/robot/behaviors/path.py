"""A path of straight pieces by arc length, how a robot keeps to it (pure pursuit), where a leader drove, and `path`."""

import math
from bisect import bisect_right
from collections.abc import Iterable, Sequence
from typing import Annotated, NamedTuple

from msgspec import Meta, Struct

from zteam.config.numbers import Coordinate
from zteam.config.problems import KeyValueError
from zteam.geometry import Point2, Pose2, curvature_to, normalize_angle
from zteam.messages import Twist, Vector3
from zteam.robot.behaviors.behavior import Behavior
from zteam.robot.view import NO_POSE, View, own_pose

SAME, BACK_STEP = 0.25, 0.1
"""Metres between two points at which a way is at the same place again, and between two points of the way back."""
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

    def first_beside(self, point: Point2, low: float, high: float) -> float:
        """The first of its points from `low` to `high` that is within SAME of this one; `high` without any."""
        places = zip(self._s, self._points, strict=True)
        return next((s for s, at in places if low <= s < high and math.dist(at, point) < SAME), high)

    def _point(self, piece: int, s: float) -> tuple[float, float]:
        """The point at `s`, which lies on this piece: as `at`."""
        (x, y), (to_x, to_y) = self._points[piece : piece + 2]
        share = (s - self._s[piece]) / (self._s[piece + 1] - self._s[piece])
        return x + share * (to_x - x), y + share * (to_y - y)

    def _piece(self, s: float) -> int:
        """The index of the point at which the piece around `s` begins."""
        return max(0, min(bisect_right(self._s, s) - 1, len(self._s) - 2))


def way_back(way: Polyline, place: float) -> list[Point2]:
    """From the end of a way back to this place on it, without what it went twice."""
    back, at = [way.point(way.end)], way.end
    while at > place:
        at = min(at, way.first_beside(back[-1], place, at)) - BACK_STEP
        back.append(way.point(at))
    return back


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


_SPACING = 0.1
"""Metres between two points of the trail."""
_REACH, _MOST_REACH = 0.1, 0.25
"""Metres of the way before and behind a point of the trail whose poses tell where it is: without noise, and at most."""
_STEP = 0.01
"""Metres that the leader has to come forward for its next pose to tell something of the trail."""
_REVERSE = 0.05
"""Metres that the leader backs up behind the trail's end before its trail is cut."""
_BESIDE = 0.2
"""Metres beside its trail at which it backs up another way."""
_JUMP = 1.0
"""Metres in one step after which the leader has not driven but was moved."""
_CHORD = 0.1
"""Metres on either side between which a direction is measured."""
_PLACE_GAIN, _SPEED_GAIN = 0.75, 0.25
"""Of the alpha-beta filter: critically damped."""
_NOISE_GAIN, _LEAST_NOISE = 0.05, 0.002
"""How fast the mean deviation of a pose from the place that was expected is learnt; metres that it is at least."""
_SURPRISE = 6.0
"""So many mean deviations are no noise: the leader has changed its speed, and the pose is believed."""
_STANDING, _PER_NOISE = 0.02, 8.0
"""m/s: a slower leader stands; and 1/s: so much more for each metre of noise, because its speed is then less sure."""
_LONGEST = 500.0
"""Metres of the trail that are kept at most."""


class Sample(NamedTuple):
    """A pose of the leader."""

    place: float
    pose: Pose2


class LeaderTrail:
    """Where one leader has driven, as a follower saw it. It goes straight on before its beginning.

    The poses may be noisy and late. So the trail is not the poses themselves, whose zigzag would be longer than the
    way, but a smooth line through them, which ends a little behind the leader. How far the leader has come, and how
    fast it drives, is estimated (an alpha-beta filter).
    """

    def __init__(self) -> None:
        self.leader = Pose2(0.0, 0.0, 0.0)
        """The newest pose in map."""
        self.place = 0.0
        """Where the leader is on its trail, as far as can be told."""
        self.speed = 0.0
        """Of the leader along its trail, m/s."""
        self.path = Polyline()
        """The trail up to a little behind the leader."""
        self._has_turned = False
        """Whether it ends where the leader turned round."""
        self._first = self.leader
        """The pose at the trail's beginning."""
        self._noise = 0.005
        """Metres: the mean deviation of a pose from the place that was expected."""
        self.stamp = 0
        """Of that pose, ns."""
        self._samples: list[Sample] = []
        """The newest poses, by place: from a little before the end of `path` on."""

    @property
    def stands(self) -> bool:
        """Whether the leader stands, as far as can be told."""
        return abs(self.speed) < _STANDING + _PER_NOISE * (self._noise - _LEAST_NOISE)

    def forget(self) -> None:
        """Begin anew with the next pose."""
        self.path = Polyline()

    def is_far(self, leader: Pose2) -> bool:
        """Whether the leader cannot have driven to this pose from the last one: it was set down there."""
        return not len(self.path) or math.hypot(leader.x - self.leader.x, leader.y - self.leader.y) > _JUMP

    def begin(self, first: Pose2, way: Iterable[Point2], leader: Pose2, stamp: int) -> None:
        """Begin anew with a way from `first` to this pose of the leader, of time `stamp` (ns)."""
        self.path = Polyline([first[:2], *way, leader[:2]])
        self._first, self.leader, self.stamp = first, leader, stamp
        self.place, self.speed = self.path.end, 0.0
        self._samples, self._has_turned = [Sample(self.place, leader)], False

    def add(self, leader: Pose2, stamp: int, keep: float) -> None:
        """The leader's newest pose, of time `stamp` (ns); forgets what lies more than `keep` metres behind."""
        if self.is_far(leader):
            self.begin(leader, (), leader, stamp)
            return
        seconds = (stamp - self.stamp) / 1e9
        if seconds <= 0.0:
            return
        self.leader, self.stamp = leader, stamp
        self._estimate(self._measure(leader), seconds)
        self._grow(leader)
        keep = min(keep, _LONGEST)
        if self.place - self.path.start > keep + 1.0:
            self._first = self.at(self.place - keep)
            self.path.drop_before(self.place - keep)

    def at(self, place: float) -> Pose2:
        """The pose that the leader had at this place; extrapolated straight behind the beginning and ahead."""
        path = self.path
        if place >= self.place:
            return self.leader.compose(Pose2(place - self.place, 0.0, 0.0))
        if place <= path.start:
            return self._first.compose(Pose2(place - path.start, 0.0, 0.0))
        if place > path.end - _CHORD:
            return between([*self._samples, Sample(self.place, self.leader)], place)
        (x, y), behind, ahead = path.point(place), path.point(place - _CHORD), path.point(place + _CHORD)
        return Pose2(x, y, math.atan2(ahead[1] - behind[1], ahead[0] - behind[0]))

    def curvature(self, place: float) -> float:
        """1/m, left positive."""
        low, high = place - _CHORD, min(place + _CHORD, self.place)
        low = min(low, high - _CHORD)
        return normalize_angle(self.at(high).yaw - self.at(low).yaw) / (high - low)

    def _measure(self, leader: Pose2) -> float:
        """The place of this pose. Cuts the trail if the leader has backed up behind its end."""
        path = self.path
        if self._has_turned:
            return path.end + math.hypot(leader.x - path.last[0], leader.y - path.last[1])
        # The direction of a single point is the leader's.
        tip = path.at(path.end) if len(path) > 1 else Pose2(*path.last, leader.yaw)
        ahead, _ = tip.locate(leader.x, leader.y)
        backs_up = ahead <= -_REVERSE
        place = path.project(leader.x, leader.y, path.end - _JUMP) if backs_up else path.end
        is_beside = backs_up and math.dist(leader[:2], path.point(place)) > _BESIDE
        if is_beside or math.cos(leader.yaw - tip.yaw) < 0.0:
            # It has turned round, or backs up another way: the trail goes on from here.
            path.append(leader.x, leader.y)
            self._samples, self._has_turned = [Sample(path.end, leader)], True
            return path.end
        if ahead >= 0.0:
            return path.end + math.dist(leader[:2], tip[:2])
        if ahead > -_REVERSE:
            return path.end + ahead
        path.cut_after(place)
        self._samples = []
        return path.end

    def _estimate(self, measured: float, seconds: float) -> None:
        expected = self.place + self.speed * seconds
        error = measured - expected
        most = _SURPRISE * self._noise
        is_surprise = abs(error) > most
        self.place = expected + (1.0 if is_surprise else _PLACE_GAIN) * error
        self.speed += (1.0 if is_surprise else _SPEED_GAIN) * error / seconds
        self._noise = max(_LEAST_NOISE, self._noise + _NOISE_GAIN * (min(abs(error), most) - self._noise))

    def _grow(self, leader: Pose2) -> None:
        """Add the points of the trail that the leader is far enough ahead of."""
        path, samples = self.path, self._samples
        while samples and samples[-1].place > self.place + _REVERSE:
            samples.pop()
        if not samples or self.place >= samples[-1].place + _STEP:
            samples.append(Sample(self.place, leader))
        if self.place < path.end + _SPACING + _REACH:
            return
        reach = min(_MOST_REACH, _REACH + 10.0 * (self._noise - _LEAST_NOISE))
        while self.place >= path.end + _SPACING + reach:
            place = path.end + _SPACING
            while len(samples) > 1 and samples[1].place < place - _MOST_REACH:
                samples.pop(0)
            before = path.end
            path.append(*fit(samples, place, reach))
            self._has_turned = False
            if path.end == before:
                break


def fit(samples: Sequence[Sample], place: float, reach: float) -> tuple[float, float]:
    """The point at `place` of the least-squares parabola of all samples within `reach`; with too few, as `between`."""
    s0 = s1 = s2 = s3 = s4 = x0 = x1 = x2 = y0 = y1 = y2 = 0.0
    for at, (x, y, _yaw) in samples:
        u = (at - place) / reach
        if abs(u) > 1.0:
            continue
        v = u * u
        s0, s1, s2, s3, s4 = s0 + 1.0, s1 + u, s2 + v, s3 + u * v, s4 + v * v
        x0, x1, x2 = x0 + x, x1 + u * x, x2 + v * x
        y0, y1, y2 = y0 + y, y1 + u * y, y2 + v * y
    # The constant term of the parabola, by Cramer's rule on the normal equations.
    a, b, c = s2 * s4 - s3 * s3, s2 * s3 - s1 * s4, s1 * s3 - s2 * s2
    det = s0 * a + s1 * b + s2 * c
    if s0 < 4.0 or det < 1e-3:
        return between(samples, place)[:2]
    return (x0 * a + x1 * b + x2 * c) / det, (y0 * a + y1 * b + y2 * c) / det


def between(samples: Sequence[Sample], place: float) -> Pose2:
    """The pose at `place` between the samples on either side; the first or the last one beyond them."""
    after = next((i for i, sample in enumerate(samples) if sample.place > place), len(samples))
    if after == 0 or after == len(samples):
        return samples[min(after, len(samples) - 1)].pose
    (begin, a), (end, b) = samples[after - 1], samples[after]
    share = (place - begin) / (end - begin)
    yaw = a.yaw + share * normalize_angle(b.yaw - a.yaw)
    return Pose2(a.x + share * (b.x - a.x), a.y + share * (b.y - a.y), yaw)


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
        place = path.project(own.x, own.y, *window)
        # Where the path turns back on itself the point to drive to would be where the robot is.
        while place + AHEAD < path.end and math.dist(own[:2], path.point(place + AHEAD)) < 0.5 * AHEAD:
            place += 0.5 * AHEAD
        return place

    def _add_lap(self) -> None:
        """From the last waypoint on to the first, and round to the last."""
        for x, y in self.params.waypoints:
            self._path.append(x, y)
