"""Small worlds for the simulator's core: square robots, a wall, bitmaps."""

import math
from typing import Any

import numpy as np

from zteam.geometry import Pose2
from zteam.messages import Twist, Vector3
from zteam.simulator.world.model import Floorplan, Obstacle, Ranger, Robot, Shape, World

BODY = ((-0.2, -0.2), (0.2, -0.2), (0.2, 0.2), (-0.2, 0.2))
LASER = Ranger("laser", 0.0, 0.0, 0.1, 0.0, math.pi, 91, 0.0, 8.0)


def make_robot(x: float = 0.0, y: float = 0.0, yaw: float = 0.0, **changes: Any) -> Robot:
    """A square robot of 0.4 m with a laser of 91 rays at its centre, 0.1 m above the ground."""
    fields: dict[str, Any] = {
        "name": "r",
        "model": "square",
        "pose": Pose2(x, y, yaw),
        "shapes": (Shape(BODY, 0.0, 0.3),),
        "rangers": (LASER,),
    }
    return Robot(**(fields | changes))


def make_box(name: str, x: float, y: float, size: float = 0.4, **changes: Any) -> Obstacle:
    """A box of 0.5 m height."""
    half = 0.5 * size
    points = ((-half, -half), (half, -half), (half, half), (-half, half))
    return Obstacle(name, Pose2(x, y, 0.0), (Shape(points, 0.0, 0.5, color="blue"),), **changes)


def make_world(*robots: Robot, wall_at: float = 3.0, others: tuple[Obstacle, ...] = (), **changes: Any) -> World:
    """Robots and a wall 0.2 m thick with its near face at x = `wall_at`; a tick is 0.1 s."""
    wall = Shape(((0.0, -5.0), (0.2, -5.0), (0.2, 5.0), (0.0, 5.0)), 0.0, 1.0, ranger_return=0.7, color="green")
    standing = (Obstacle("wall", Pose2(wall_at, 0.0, 0.0), (wall,)), *others)
    return World("test", 100_000_000, (), standing, robots, **changes)


def make_maze(*robots: Robot, seed: int = 0) -> World:
    """A walled bitmap of 8 x 8 m with blocks in it, its middle free; robots start wherever they say."""
    random = np.random.default_rng(seed)
    occupied = np.zeros((40, 40), bool)
    occupied[[0, -1], :] = occupied[:, [0, -1]] = True
    for row, column in random.integers(3, 34, (12, 2)):
        occupied[row : row + 3, column : column + 2] = True
    occupied[16:24, 16:24] = False
    plan = Floorplan("maze", occupied, (0.2, 0.2), Pose2(-4.0, -4.0, 0.0), 0.0, 1.0)
    return World("maze", 100_000_000, (plan,), (), robots)


def drive(v: float, w: float = 0.0, vy: float = 0.0) -> Twist:
    """A command."""
    return Twist(Vector3(v, vy), Vector3(0.0, 0.0, w))


def is_occupied(floor: Floorplan, x: float, y: float) -> bool:
    """Whether a point of the map lies in an occupied cell of a floor."""
    dx, dy = x - floor.pose.x, y - floor.pose.y
    c, s = math.cos(floor.pose.yaw), math.sin(floor.pose.yaw)
    column, row = int((c * dx + s * dy) // floor.cell[0]), int((c * dy - s * dx) // floor.cell[1])
    rows, columns = floor.occupied.shape
    return 0 <= row < rows and 0 <= column < columns and bool(floor.occupied[row, column])
