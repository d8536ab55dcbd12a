"""What a robot does that makes no progress: one behaviour after the other, and at last it gives up with the reason."""

import math
from collections.abc import Sequence
from typing import Annotated, Literal, get_args

import msgspec

from zteam.config.numbers import NotNegative, Positive, Seconds
from zteam.config.problems import CheckedOptions
from zteam.geometry import Pose2, Velocity, normalize_angle
from zteam.navigation.planning.controller import time_to_collision
from zteam.navigation.planning.costmap import Costmap

Behavior = Literal["wait", "clear_costmap", "back_up", "spin"]

_CURVATURES = 0.0, 2.0, -2.0, 4.0, -4.0
"""1/m: the ways in which a robot tries to back up."""


class RecoveryOptions(CheckedOptions, frozen=True):
    """Parameters; numbers are those of Nav2's navigate_to_pose_w_replanning_and_recovery.xml, where it has them."""

    behaviors: tuple[Behavior, ...] = get_args(Behavior)
    """In this order, again and again."""
    number_of_retries: Annotated[int, msgspec.Meta(ge=0, le=1_000_000)] = 8
    """Behaviours after which it gives up: two rounds of all four."""
    progress_radius: NotNegative = 1.0
    """Metres from the place of the last behaviour, from which on all may be tried again."""
    wait_duration: Seconds = 2.0
    clear_distance: NotNegative = 2.0
    """Metres around the robot."""
    backup_dist: NotNegative = 0.3
    backup_speed: Positive = 0.15
    spin_dist: NotNegative = 1.57
    """Radians."""
    rotational_vel: Positive = 1.0
    max_rotational_vel: Positive = 100.0
    """Nav2's bound of `rotational_vel`."""
    simulate_ahead_time: Seconds = 1.0
    """Seconds ahead in which a motion must not touch an obstacle."""
    time_allowance: Seconds = 10.0
    """Seconds after which a motion ends, however far it came."""
    stopped_allowance: Seconds = 1.0
    """Seconds after which it tries another motion, if the robot does not move: its safety layer, say, or a wall that no
    costmap shows, does not let it."""


_MOVES = 0.02
"""Metres, or radians, that are a motion."""


class Recovery:
    """The behaviours for one goal. `begin` starts the next one, `step` carries it out until it is over."""

    def __init__(self, options: RecoveryOptions | None = None) -> None:
        self.options = options or RecoveryOptions()
        self.count = 0
        """Behaviours begun since the goal, or since the last progress."""
        self.current: Behavior | None = None
        """The behaviour that has begun and is not over."""
        self._from = Pose2(0.0, 0.0, 0.0)
        self._began = self._turned = self._last_yaw = self._moved_at = 0.0
        self._moved_to = self._from
        """Where it has moved last, at `_moved_at`."""
        self._way = 0
        """Which motion of a behaviour it tries."""

    def reset(self) -> None:
        """A new goal, or progress: all behaviours may be tried again."""
        self.count, self.current = 0, None

    def begin(self, now: float, pose: Pose2, reason: str) -> str | None:
        """Begin the next behaviour at `now` (s), or return why it gives up: `reason`, and what was tried."""
        options = self.options
        if math.hypot(pose.x - self._from.x, pose.y - self._from.y) > options.progress_radius:
            self.count = 0
        if self.count >= options.number_of_retries or not options.behaviors:
            tried = f"after {self.count} recoveries ({', '.join(options.behaviors)})" if self.count else ""
            return f"{reason}: gave up {tried}".rstrip()
        self.current = options.behaviors[self.count % len(options.behaviors)]
        self.count += 1
        self._began, self._from, self._turned, self._last_yaw = now, pose, 0.0, pose.yaw
        self._way, self._moved_at, self._moved_to = 0, now, pose
        return None

    def step(self, now: float, pose: Pose2, *costmaps: Costmap) -> Velocity | None:
        """What to do at `now` (s) with a robot at `pose`; None: the behaviour is over, plan and drive again.

        No motion touches an obstacle of any of the `costmaps`: a local one may lack the map's walls. It clears them.
        """
        moved = math.dist(pose[:2], self._moved_to[:2]), abs(normalize_angle(pose.yaw - self._moved_to.yaw))
        if max(moved) > _MOVES:
            self._moved_at, self._moved_to = now, pose
        options, velocity = self.options, None
        self._turned += abs(normalize_angle(pose.yaw - self._last_yaw))
        self._last_yaw = pose.yaw
        if self.current == "wait":
            velocity = Velocity() if now - self._began < options.wait_duration else None
        elif self.current == "clear_costmap":
            for costmap in costmaps:
                costmap.clear_around(pose, options.clear_distance)
                costmap.update()
        elif self.current == "back_up" and math.dist(pose[:2], self._from[:2]) < options.backup_dist:
            speed = -options.backup_speed
            # A robot that came in on an arc may come out on one only.
            ways = [Velocity(speed, 0.0, speed * curvature) for curvature in _CURVATURES]
            velocity = self._move(ways, now, pose, costmaps)
        elif self.current == "spin" and self._turned < options.spin_dist:
            rate = min(options.rotational_vel, options.max_rotational_vel)
            velocity = self._move([Velocity(turn=rate), Velocity(turn=-rate)], now, pose, costmaps)
        if velocity is None:
            self.current = None
        return velocity

    def _move(self, ways: Sequence[Velocity], now: float, pose: Pose2, costmaps: Sequence[Costmap]) -> Velocity | None:
        """The first of these motions that nothing is in the way of, once tried not again; none when its time is up."""
        ahead = self.options.simulate_ahead_time
        for velocity in ways[self._way :] if now - self._began <= self.options.time_allowance else ():
            is_blocked = any(time_to_collision(costmap, pose, velocity, ahead) < math.inf for costmap in costmaps)
            if not is_blocked and now - self._moved_at <= self.options.stopped_allowance:
                return velocity
            self._way, self._moved_at = self._way + 1, now
        return None
