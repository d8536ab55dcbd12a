"""Controllers: a path, a costmap and a pose in, a velocity out; and when a goal is reached or a robot does not get on.

A command is checked before it is given: whether the robot's outline would touch lethal cells on the way. A cell that
the outline touches already where the robot stands does not count: it may leave it, and enters no other one.
"""

import math
from typing import Annotated, Protocol

import msgspec
import numpy as np

from zteam.config.numbers import NotNegative, Positive, Seconds, Signed
from zteam.config.problems import CheckedOptions
from zteam.errors import ZteamError
from zteam.geometry import FAR, Pose2, Velocity, curvature_to, normalize_angle
from zteam.kernels.binding import Floats
from zteam.kernels.navigation import PathPlace
from zteam.navigation.planning.costmap import FREE_SPACE, INSCRIBED_INFLATED_OBSTACLE, MAX_NON_OBSTACLE, Costmap


def time_to_collision(costmap: Costmap, pose: Pose2, velocity: Velocity, duration: float) -> float:
    """Seconds until a robot with `velocity` touches a lethal cell that it does not touch at `pose`; inf if later."""
    return costmap.layers.time_to_collision(pose, velocity, duration)


class BlockedError(ZteamError):
    """No command leads on without touching an obstacle; the text says where."""


class Controller(Protocol):
    """What a controller must do; `zteam.navigation.planning.parameters` knows them by name."""

    def set_path(self, path: Floats) -> None:
        """Follow this path (n, 3) from now on: x, y in metres and yaw in radians, in the frame of the map."""

    def command(self, costmap: Costmap, pose: Pose2, velocity: Velocity, seconds: float) -> Velocity:
        """The velocity for a robot at `pose` that has `velocity`; the next call comes `seconds` later.

        Raises BlockedError.
        """

    def remaining(self) -> float:
        """Metres of the path that lie before the robot."""


class PursuitOptions(CheckedOptions, frozen=True):
    """Parameters of RegulatedPurePursuitController, with Nav2's names and defaults."""

    desired_linear_vel: Positive = 0.5
    lookahead_dist: Positive = 0.6
    min_lookahead_dist: Positive = 0.3
    max_lookahead_dist: Positive = 0.9
    lookahead_time: Seconds = 1.5
    use_velocity_scaled_lookahead_dist: bool = False
    min_approach_linear_velocity: NotNegative = 0.05
    approach_velocity_scaling_dist: NotNegative = 0.6
    use_collision_detection: bool = True
    max_allowed_time_to_collision_up_to_carrot: Seconds = 1.0
    use_regulated_linear_velocity_scaling: bool = True
    use_cost_regulated_linear_velocity_scaling: bool = True
    regulated_linear_scaling_min_radius: NotNegative = 0.9
    regulated_linear_scaling_min_speed: NotNegative = 0.25
    cost_scaling_dist: Positive = 0.6
    cost_scaling_gain: NotNegative = 1.0
    inflation_cost_scaling_factor: NotNegative | None = None
    """1/m, to tell from a cost how far an obstacle is. None: that of the costmap, as it should be; 0: do not tell."""
    use_rotate_to_heading: bool = True
    rotate_to_heading_angular_vel: Positive = 1.8
    rotate_to_heading_min_angle: Annotated[float, msgspec.Meta(ge=0.01, le=math.pi)] = 0.785
    max_angular_accel: Positive = 3.2
    max_robot_pose_search_dist: Signed = 3.0
    """Metres of the path ahead in which the robot's place on it is looked for; 0 or less: the whole path."""
    xy_goal_tolerance: Positive = 0.25
    """Metres to the end of the path within which the robot only turns to the heading that is asked for."""
    stateful: bool = True
    """Once within, it goes on to turn until there is another path, also where its pose is corrected meanwhile."""


_NEARER = (1.0, 0.7, 0.45, 0.3)
"""Shares of the look-ahead distance that are tried: a nearer carrot cuts corners less."""
_SPEEDS = (1.0, 0.5, 0.0, -0.5)
"""Shares of the slow speed, and ..."""
_TURNS = (0.0, 0.4, -0.4, 0.8, -0.8, 1.2, -1.2)
"""... rad/s that are tried where no carrot can be driven to."""
_AHEAD = 0.6
"""Seconds for which such a motion must be free."""
_WORTH = 0.01
"""Metres by which it must be better than to stand still."""


class RegulatedPurePursuit:
    """Drives in arcs to a point of the path ahead: slower in bends, near obstacles and near the end.

    Macenski et al. 2023, "Regulated pure pursuit for robot path tracking", as nav2_regulated_pure_pursuit_controller
    does it. Where the arc would touch an obstacle within `max_allowed_time_to_collision_up_to_carrot`, it takes a
    nearer point of the path, and at last any slow motion that leads there and touches nothing.
    """

    def __init__(self, options: PursuitOptions | None = None) -> None:
        self.options = options or PursuitOptions()
        self._path: Floats = np.empty((0, 3))
        self._left = [0.0]
        """Metres from each pose of the path to its end."""
        self._place = PathPlace(self._path, np.empty(0))
        self._rotating = self._at_end = False

    def set_path(self, path: Floats) -> None:
        """Follow this path (n, 3) from its beginning. Raises ValueError for one that is empty or not finite."""
        if path.ndim != 2 or path.shape[1] != 3 or not len(path) or not np.isfinite(path).all():
            raise ValueError(f"a path is an array (n, 3) of finite poses, not one of shape {path.shape}")
        self._path = np.ascontiguousarray(path, np.float64)
        steps = np.hypot(*np.diff(path[:, :2], axis=0).T)
        along = np.concatenate(([0.0], np.cumsum(steps)))
        self._left, self._place = (along[-1] - along).tolist(), PathPlace(self._path, along)
        self._rotating = self._at_end = False

    def remaining(self) -> float:
        return self._left[self._place.at]

    def command(self, costmap: Costmap, pose: Pose2, velocity: Velocity, seconds: float) -> Velocity:
        """See Controller.command. Raises IndexError without a path."""
        options = self.options
        end = self._path[-1].tolist()
        ahead = options.max_robot_pose_search_dist
        self._place.advance(pose.x, pose.y, ahead if ahead > 0.0 else FAR)
        to_end = math.hypot(end[0] - pose.x, end[1] - pose.y)
        if not (self._at_end and options.stateful):
            near = options.xy_goal_tolerance
            self._at_end = to_end <= near and self.remaining() <= 2.0 * near
        if self._at_end:
            return self._turn_to_goal(costmap, pose, velocity, normalize_angle(end[2] - pose.yaw), seconds)
        reach = options.lookahead_dist
        if options.use_velocity_scaled_lookahead_dist:
            ahead = abs(velocity.x) * options.lookahead_time
            reach = min(max(ahead, options.min_lookahead_dist), options.max_lookahead_dist)
        for share in _NEARER if options.use_collision_detection else _NEARER[:1]:
            x, y = self._carrot(pose, share * reach)
            heading, distance = math.atan2(y, x), math.hypot(x, y)
            # Once it turns on the spot, it does so until it faces the point.
            most = options.rotate_to_heading_min_angle * (0.25 if self._rotating else 1.0)
            self._rotating = options.use_rotate_to_heading and abs(heading) > most
            if self._rotating:
                command, horizon = self._rotate(velocity, heading, seconds)
            else:
                curvature = curvature_to(y, distance * distance)
                speed = self._regulate(costmap, pose, curvature, max(to_end, self.remaining()))
                command = Velocity(speed, 0.0, speed * curvature)
                horizon = min(options.max_allowed_time_to_collision_up_to_carrot, distance / max(speed, 1e-3))
            if not options.use_collision_detection or _is_free(costmap, pose, command, max(horizon, seconds)):
                return command
        return self._squeeze(costmap, pose, self._carrot(pose, reach), seconds)

    def _carrot(self, pose: Pose2, reach: float) -> tuple[float, float]:
        """The point to drive to, in the robot's frame: where the path leaves the circle of this radius (m)."""
        far = self._place.leave(pose.x, pose.y, reach)
        if far <= self._place.at:
            x, y, _ = self._path[far].tolist()
            return pose.locate(x, y)
        # Between two poses: linear in the distance, which is close enough for poses a cell apart.
        (x, y, _), (to_x, to_y, _) = self._path[far - 1 : far + 1].tolist()
        near, away = np.hypot((x - pose.x, to_x - pose.x), (y - pose.y, to_y - pose.y)).tolist()
        share = (reach - near) / max(away - near, 1e-9)
        return pose.locate(x + share * (to_x - x), y + share * (to_y - y))

    def _rotate(self, velocity: Velocity, angle: float, seconds: float) -> tuple[Velocity, float]:
        """A turn on the spot by `angle`, and the seconds for which it must be free."""
        options = self.options
        # As fast as it can still stop at the heading.
        rate = min(options.rotate_to_heading_angular_vel, math.sqrt(2.0 * options.max_angular_accel * abs(angle)))
        rate = math.copysign(min(rate, abs(angle) / seconds), angle)
        change = options.max_angular_accel * seconds
        rate = min(max(rate, velocity.turn - change), velocity.turn + change)
        whole = abs(angle) / max(abs(rate), 1e-3)
        return Velocity(turn=rate), min(options.max_allowed_time_to_collision_up_to_carrot, whole)

    def _turn_to_goal(
        self, costmap: Costmap, pose: Pose2, velocity: Velocity, angle: float, seconds: float
    ) -> Velocity:
        """Turn to the heading of the goal; the other way round where something stands in the way."""
        for way in (angle, angle - math.copysign(math.tau, angle)):
            command, horizon = self._rotate(velocity, way, seconds)
            if not self.options.use_collision_detection or _is_free(costmap, pose, command, max(horizon, seconds)):
                return command
        raise BlockedError(f"at ({pose.x:.2f}, {pose.y:.2f}) a turn on the spot would touch an obstacle")

    def _regulate(self, costmap: Costmap, pose: Pose2, curvature: float, remaining: float) -> float:
        """The speed in a bend, beside obstacles and before the end."""
        options = self.options
        full = options.desired_linear_vel
        in_bend = by_cost = full
        if options.use_regulated_linear_velocity_scaling:
            # Radius / least radius, up to 1.
            in_bend = full * min(1.0, 1.0 / max(abs(curvature) * options.regulated_linear_scaling_min_radius, 1e-9))
        cost = costmap.cost_at(pose.x, pose.y)
        factor = options.inflation_cost_scaling_factor
        factor = costmap.options.cost_scaling_factor if factor is None else factor
        regulates = options.use_cost_regulated_linear_velocity_scaling and factor > 0.0
        if regulates and FREE_SPACE < cost <= INSCRIBED_INFLATED_OBSTACLE:
            distance = costmap.footprint.inscribed_radius - math.log(cost / MAX_NON_OBSTACLE) / factor
            if distance < options.cost_scaling_dist:
                by_cost = full * options.cost_scaling_gain * max(0.0, distance) / options.cost_scaling_dist
        speed = max(min(in_bend, by_cost), min(full, options.regulated_linear_scaling_min_speed))
        if remaining < options.approach_velocity_scaling_dist:
            slowed = full * remaining / options.approach_velocity_scaling_dist
            speed = min(speed, max(options.min_approach_linear_velocity, slowed))
        return speed

    def _squeeze(self, costmap: Costmap, pose: Pose2, carrot: tuple[float, float], seconds: float) -> Velocity:
        """Of some slow motions that touch nothing, the one after which the robot faces the carrot best, or is nearest.

        Raises BlockedError if none is better than to stand still.
        """
        best, least = None, _badness(carrot, Velocity(), _AHEAD) - _WORTH
        slow = min(self.options.desired_linear_vel, self.options.regulated_linear_scaling_min_speed)
        for share in _SPEEDS:
            for turn in _TURNS:
                command = Velocity(share * slow, 0.0, turn)
                badness = _badness(carrot, command, _AHEAD)
                if badness < least and _is_free(costmap, pose, command, max(_AHEAD, seconds)):
                    best, least = command, badness
        if best is None:
            raise BlockedError(f"at ({pose.x:.2f}, {pose.y:.2f}) every way on along the path would touch an obstacle")
        return best


def _is_free(costmap: Costmap, pose: Pose2, command: Velocity, seconds: float) -> bool:
    return time_to_collision(costmap, pose, command, seconds) == math.inf


def _badness(carrot: tuple[float, float], command: Velocity, seconds: float) -> float:
    """Metres from the carrot after a motion, and half a metre for each radian that the robot does not face it."""
    half = 0.5 * command.turn * seconds
    length = command.x * seconds
    dx, dy = carrot[0] - length * math.cos(half), carrot[1] - length * math.sin(half)
    return math.hypot(dx, dy) + 0.5 * abs(normalize_angle(math.atan2(dy, dx) - 2.0 * half))


class GoalOptions(CheckedOptions, frozen=True):
    """Parameters, with Nav2's names and defaults."""

    xy_goal_tolerance: Positive = 0.25
    yaw_goal_tolerance: Positive = 0.25
    stateful: bool = True
    """Once the place is reached, only the heading counts."""


class GoalChecker:
    """Whether one goal is reached. A new goal needs a new checker, or `reset`."""

    def __init__(self, options: GoalOptions | None = None) -> None:
        self.options = options or GoalOptions()
        self.there = False
        """Whether the place is reached, and only the heading is left."""

    def reset(self) -> None:
        self.there = False

    def is_reached(self, pose: Pose2, goal: Pose2) -> bool:
        """Whether a robot at `pose` is at the goal; a goal whose yaw is NaN takes any heading."""
        if not (self.there and self.options.stateful):
            self.there = math.hypot(goal.x - pose.x, goal.y - pose.y) <= self.options.xy_goal_tolerance
        if not self.there:
            return False
        return math.isnan(goal.yaw) or (abs(normalize_angle(goal.yaw - pose.yaw)) <= self.options.yaw_goal_tolerance)


class ProgressOptions(CheckedOptions, frozen=True):
    """Parameters, with Nav2's names and defaults."""

    required_movement_radius: NotNegative = 0.5
    movement_time_allowance: Annotated[float, msgspec.Meta(ge=0.1, le=1e6)] = 10.0


class ProgressChecker:
    """Whether a robot that should drive gets on."""

    def __init__(self, options: ProgressOptions | None = None) -> None:
        self.options = options or ProgressOptions()
        self._from: Pose2 | None = None
        self._since = 0.0

    def reset(self) -> None:
        self._from = None

    def makes_progress(self, now: float, pose: Pose2) -> bool:
        """Whether the robot has moved far enough within the time allowed; `now` is in seconds."""
        start, options = self._from, self.options
        if start is None or math.hypot(pose.x - start.x, pose.y - start.y) > options.required_movement_radius:
            self._from, self._since = pose, now
            return True
        return now - self._since <= options.movement_time_allowance
