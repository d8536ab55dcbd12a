"""When a goal is reached, and when a robot does not get on: SimpleGoalChecker and SimpleProgressChecker of Nav2."""

import math
from typing import NamedTuple

from zteam.geometry import Pose2, normalize_angle


class GoalOptions(NamedTuple):
    """Parameters, with Nav2's names and defaults."""

    xy_goal_tolerance: float = 0.25
    yaw_goal_tolerance: float = 0.25
    stateful: bool = True
    """Once the place is reached, only the heading counts."""


class GoalChecker:
    """Whether one goal is reached. A new goal needs a new checker, or `reset`."""

    def __init__(self, options: GoalOptions | None = None) -> None:
        self.options = options or GoalOptions()
        self._there = False

    def reset(self) -> None:
        """Begin with another goal."""
        self._there = False

    def is_reached(self, pose: Pose2, goal: Pose2) -> bool:
        """Whether a robot at `pose` is at the goal; a goal whose yaw is NaN takes any heading."""
        if not (self._there and self.options.stateful):
            self._there = math.hypot(goal.x - pose.x, goal.y - pose.y) <= self.options.xy_goal_tolerance
        if not self._there:
            return False
        return math.isnan(goal.yaw) or (abs(normalize_angle(goal.yaw - pose.yaw)) <= self.options.yaw_goal_tolerance)


class ProgressOptions(NamedTuple):
    """Parameters, with Nav2's names and defaults."""

    required_movement_radius: float = 0.5
    movement_time_allowance: float = 10.0


class ProgressChecker:
    """Whether a robot that should drive gets on."""

    def __init__(self, options: ProgressOptions | None = None) -> None:
        self.options = options or ProgressOptions()
        self._from: Pose2 | None = None
        self._since = 0.0

    def reset(self) -> None:
        """Begin anew at the next check."""
        self._from = None

    def makes_progress(self, now: float, pose: Pose2) -> bool:
        """Whether the robot has moved far enough within the time allowed; `now` is in seconds."""
        start, options = self._from, self.options
        if start is None or math.hypot(pose.x - start.x, pose.y - start.y) > options.required_movement_radius:
            self._from, self._since = pose, now
            return True
        return now - self._since <= options.movement_time_allowance
