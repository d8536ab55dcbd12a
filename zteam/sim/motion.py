"""What a base makes of its commands: velocities within its limits, and the way it then goes."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from zteam.sim.jit import compiled
from zteam.world.model import Robot

Floats = NDArray[np.float64]


class Drives(NamedTuple):
    """Of all robots. Columns are x, y (m/s) and yaw (rad/s), in the base frame."""

    low: Floats
    """(robots, 3): least velocity."""
    high: Floats
    slow: Floats
    """(robots, 3): least acceleration (below 0); -inf where the world file gives none."""
    fast: Floats
    is_car: NDArray[np.bool_]
    wheelbase: Floats


def make_drives(robots: Sequence[Robot]) -> Drives:
    """Limits of the robots; only omni drives go sideways."""
    low, high, slow, fast = np.empty((4, len(robots), 3))
    for i, robot in enumerate(robots):
        for axis, (least, most) in enumerate((robot.velocity.x, robot.velocity.y, robot.velocity.yaw)):
            low[i, axis], high[i, axis] = least, most
        if robot.drive != "omni":
            low[i, 1] = high[i, 1] = 0.0
        given = robot.acceleration
        bounds = (given.x, given.y, given.yaw) if given else ((-math.inf, math.inf),) * 3
        for axis, (least, most) in enumerate(bounds):
            slow[i, axis], fast[i, axis] = least, most
    is_car = np.array([robot.drive == "car" for robot in robots], bool)
    return Drives(low, high, slow, fast, is_car, np.array([robot.wheelbase for robot in robots], float))


@compiled
def obey(drives: Drives, commands: Floats, fresh: NDArray[np.bool_], seconds: float, velocity: Floats) -> None:
    """Change `velocity` (robots, 3) towards `commands` as far as the limits allow in `seconds`; a stale one is 0.

    A car's angular command is Stage's: the angle of the steered wheels, v sin(angle) / wheelbase the yaw rate. While a
    car gathers or loses speed it turns no more sharply than its wheels are steered.
    """
    for i in range(velocity.shape[0]):
        # Yaw rate over speed, as commanded; while a car comes to a stand, as it was.
        bend = abs(velocity[i, 2] / velocity[i, 0]) if velocity[i, 0] != 0.0 else 0.0
        speed = 0.0
        for axis in range(3):
            goal = commands[i, axis]
            if drives.is_car[i]:
                angle = commands[i, 2]
                if axis == 0:
                    goal = commands[i, 0] * math.cos(angle)
                elif axis == 2:
                    goal = commands[i, 0] * math.sin(angle) / drives.wheelbase[i]
            goal = min(max(goal, drives.low[i, axis]), drives.high[i, axis]) if fresh[i] else 0.0
            least = velocity[i, axis] + drives.slow[i, axis] * seconds
            most = velocity[i, axis] + drives.fast[i, axis] * seconds
            velocity[i, axis] = min(max(goal, least), most)
            if axis == 0:
                speed = goal
        if drives.is_car[i]:
            bend = abs(goal / speed) if speed != 0.0 else bend
            most = bend * abs(velocity[i, 0]) * (1.0 + 1e-12)
            velocity[i, 2] = min(max(velocity[i, 2], -most), most)


def keep_what_is_left(drives: Drives, met: NDArray[np.bool_], velocity: Floats, setpoint: Floats) -> None:
    """Of the `setpoint` of robots that `met` something keep what they made of it, their `velocity`; both (robots, 3).

    So a robot that comes free gathers speed from there. A contact takes speed away and never adds any: what pushes a
    robot does not drive it. A car's turn shrinks with its speed.
    """
    told = setpoint[met]
    made = np.clip(velocity[met], np.minimum(told, 0.0), np.maximum(told, 0.0))
    cars = drives.is_car[met] & (told[:, 0] != 0.0)
    made[cars, 2] = told[cars, 2] * made[cars, 0] / told[cars, 0]
    setpoint[met] = made


@compiled
def follow_arcs(poses: Floats, velocity: Floats, seconds: float, ends: Floats) -> None:
    """Where robots at `poses` (x, y, yaw) get to at constant body velocity: the exact arc, into `ends`."""
    for i in range(velocity.shape[0]):
        turn = velocity[i, 2] * seconds
        half = 0.5 * turn
        # The chord of the arc: sin(half) / half long, half the turn to the side.
        chord = seconds * (math.sin(half) / half if abs(half) > 1e-9 else 1.0)
        heading = poses[i, 2] + half
        cos, sin = math.cos(heading) * chord, math.sin(heading) * chord
        ends[i, 0] = poses[i, 0] + cos * velocity[i, 0] - sin * velocity[i, 1]
        ends[i, 1] = poses[i, 1] + sin * velocity[i, 0] + cos * velocity[i, 1]
        ends[i, 2] = poses[i, 2] + turn


@compiled
def find_ways(poses: Floats, velocity: Floats, seconds: float, ways: Floats) -> float:
    """The same as differences from `poses`, into `ways`; the longest of them along x or y."""
    follow_arcs(poses, velocity, seconds, ways)
    longest = 0.0
    for i in range(velocity.shape[0]):
        for axis in range(3):
            ways[i, axis] -= poses[i, axis]
        longest = max(longest, abs(ways[i, 0]), abs(ways[i, 1]))
    return longest


@compiled
def follow_tangents(poses: Floats, velocity: Floats, seconds: float, ends: Floats) -> None:
    """As Stage steps (Euler): straight ahead by the old heading, then the turn."""
    for i in range(velocity.shape[0]):
        cos, sin = math.cos(poses[i, 2]) * seconds, math.sin(poses[i, 2]) * seconds
        ends[i, 0] = poses[i, 0] + cos * velocity[i, 0] - sin * velocity[i, 1]
        ends[i, 1] = poses[i, 1] + sin * velocity[i, 0] + cos * velocity[i, 1]
        ends[i, 2] = poses[i, 2] + velocity[i, 2] * seconds


@compiled
def measure_velocity(before: Floats, after: Floats, seconds: float, velocity: Floats) -> None:
    """The body velocity (robots, 3) of the arcs that lead from `before` to `after`: what the bases did."""
    for i in range(velocity.shape[0]):
        turn = after[i, 2] - before[i, 2]
        half = 0.5 * turn
        # The way made good, seen from half the turn and stretched from the chord to the arc.
        stretch = (half / math.sin(half) if abs(half) > 1e-9 else 1.0) / seconds
        cos, sin = math.cos(before[i, 2] + half) * stretch, math.sin(before[i, 2] + half) * stretch
        dx, dy = after[i, 0] - before[i, 0], after[i, 1] - before[i, 1]
        velocity[i, 0], velocity[i, 1] = cos * dx + sin * dy, cos * dy - sin * dx
        velocity[i, 2] = turn / seconds


@compiled
def measure_tangents(before: Floats, after: Floats, seconds: float, velocity: Floats) -> None:
    """The body velocity (robots, 3) of Stage's steps from `before` to `after`, by the heading before."""
    for i in range(velocity.shape[0]):
        cos, sin = math.cos(before[i, 2]) / seconds, math.sin(before[i, 2]) / seconds
        dx, dy = after[i, 0] - before[i, 0], after[i, 1] - before[i, 1]
        velocity[i, 0], velocity[i, 1] = cos * dx + sin * dy, cos * dy - sin * dx
        velocity[i, 2] = (after[i, 2] - before[i, 2]) / seconds
