"""Whether a robot's outline touches lethal cells: at a pose, and on the way of a command.

A cell that the outline touches already where the robot stands does not count: it may leave it, and enters no other one.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from zteam.geometry import Pose2
from zteam.planning.costmap import Costmap
from zteam.planning.costs import LETHAL_OBSTACLE, Costs
from zteam.planning.jit import compiled

Floats = NDArray[np.float64]

_STEP = 0.1
"""Cells that no point of the outline moves more than from one looked-at pose to the next."""
_MARGIN = 0.05
"""Cells that the outline keeps from lethal ones, for what happens between two poses."""


class Velocity(NamedTuple):
    """What a robot is told: m/s forwards and to the left, rad/s to the left."""

    x: float = 0.0
    y: float = 0.0
    turn: float = 0.0


@compiled
def _touches_square(u: Floats, v: Floats, column: int, row: int, margin: float) -> bool:
    """Whether a polygon touches a cell that is `margin` larger on each side; all in cells."""
    left, right = column - margin, column + 1.0 + margin
    low, high = row - margin, row + 1.0 + margin
    inside = False
    last = u.shape[0] - 1
    middle_u, middle_v = column + 0.5, row + 0.5
    for i in range(u.shape[0]):
        ax, ay, bx, by = u[last], v[last], u[i], v[i]
        last = i
        if (ay > middle_v) != (by > middle_v) and middle_u < ax + (middle_v - ay) * (bx - ax) / (by - ay):
            inside = not inside
        # The part of the edge in the square (Liang and Barsky 1984).
        begin, end = 0.0, 1.0
        dx, dy = bx - ax, by - ay
        if dx == 0.0:
            if ax < left or ax > right:
                continue
        else:
            one, other = (left - ax) / dx, (right - ax) / dx
            begin, end = max(begin, min(one, other)), min(end, max(one, other))
        if dy == 0.0:
            if ay < low or ay > high:
                continue
        else:
            one, other = (low - ay) / dy, (high - ay) / dy
            begin, end = max(begin, min(one, other)), min(end, max(one, other))
        if begin <= end:
            return True
    return inside


@compiled
def _turn(corners: Floats, x: float, y: float, yaw: float, u: Floats, v: Floats) -> None:
    cos, sin = math.cos(yaw), math.sin(yaw)
    for i in range(corners.shape[0]):
        u[i] = x + cos * corners[i, 0] - sin * corners[i, 1]
        v[i] = y + sin * corners[i, 0] + cos * corners[i, 1]


@compiled
def find_hit(costs: Costs, corners: Floats, x: float, y: float, yaw: float, motion: Floats, steps: int) -> int:
    """The first step of `steps` at which a robot touches a lethal cell that it does not touch at the start; else -1.

    All is in cells: the robot's `corners` (n, 2) in its base frame, its pose in the grid, and `motion` of one step,
    forwards, to the left and radians, on an arc. With 0 steps: 0 if it touches any lethal cell where it stands. Cells
    outside of the grid are lethal.
    """
    rows, columns = costs.shape
    count = corners.shape[0]
    u0, v0, u, v = np.empty(count), np.empty(count), np.empty(count), np.empty(count)
    _turn(corners, x, y, yaw, u0, v0)
    for step in range(0 if steps == 0 else 1, steps + 1):
        if step > 0:
            # The middle of the step's arc tells its direction.
            heading = yaw + 0.5 * motion[2]
            x += math.cos(heading) * motion[0] - math.sin(heading) * motion[1]
            y += math.sin(heading) * motion[0] + math.cos(heading) * motion[1]
            yaw += motion[2]
        _turn(corners, x, y, yaw, u, v)
        for row in range(math.floor(v.min() - _MARGIN), math.floor(v.max() + _MARGIN) + 1):
            for column in range(math.floor(u.min() - _MARGIN), math.floor(u.max() + _MARGIN) + 1):
                if 0 <= row < rows and 0 <= column < columns and costs[row, column] != LETHAL_OBSTACLE:
                    continue
                if not _touches_square(u, v, column, row, _MARGIN if step > 0 else 0.0):
                    continue
                if step == 0:
                    return 0
                if not _touches_square(u0, v0, column, row, _MARGIN):
                    return step
                # Near at the start already: then it may come nearer, but not touch it, unless it did.
                if _touches_square(u, v, column, row, 0.0) and not _touches_square(u0, v0, column, row, 0.0):
                    return step
    return -1


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
