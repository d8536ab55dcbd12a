"""Whether a robot's outline touches lethal cells: at a pose, and on the way of a command.

A cell that the outline touches already where the robot stands does not count: it may leave it, and enters no other one.
"""

import math
from typing import NamedTuple

import numpy as np

from zteam.geometry import Pose2
from zteam.kernels.binding import Floats, find_hit
from zteam.planning.costmap import Costmap

_STEP = 0.1
"""Cells that no point of the outline moves more than from one looked-at pose to the next."""


class Velocity(NamedTuple):
    """What a robot is told: m/s forwards and to the left, rad/s to the left."""

    x: float = 0.0
    y: float = 0.0
    turn: float = 0.0


def stands_free(costmap: Costmap, pose: Pose2) -> bool:
    """Whether a robot at `pose` (in `map`) touches no lethal cell."""
    return find_hit(costmap.costs, *_in_cells(costmap, pose), np.zeros(3), 0) < 0


def time_to_collision(costmap: Costmap, pose: Pose2, velocity: Velocity, duration: float) -> float:
    """Seconds until a robot that drives with `velocity` from `pose` on touches a lethal cell; inf if not in `duration`.

    Cells that it touches at `pose` do not count.
    """
    resolution = costmap.frame.resolution
    speed = math.hypot(velocity.x, velocity.y) + abs(velocity.turn) * costmap.footprint.circumscribed_radius
    steps = math.ceil(speed * duration / (_STEP * resolution))
    if steps == 0:
        return math.inf
    interval = duration / steps
    motion = np.array([velocity.x / resolution, velocity.y / resolution, velocity.turn]) * interval
    hit = find_hit(costmap.costs, *_in_cells(costmap, pose), motion, steps)
    return math.inf if hit < 0 else (hit - 1) * interval


def _in_cells(costmap: Costmap, pose: Pose2) -> tuple[Floats, float, float, float]:
    frame = costmap.frame
    u, v = frame.to_cells(pose.x, pose.y)
    return costmap.footprint.corners / frame.resolution, u, v, pose.yaw - frame.origin.yaw
