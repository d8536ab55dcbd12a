"""The bases of robots: their limits, their wheels, and what a contact leaves of a speed."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from zteam.kernels.binding import Bases
from zteam.world.model import Robot

Floats = NDArray[np.float64]


_JOINTS = {
    # Wheel rates are rows times (vx, vy, w), over the wheel's radius; lengths in halves of the separation. A mecanum
    # base is taken to be square.
    "diff": (("wheel_left_joint", (1.0, 0.0, -1.0)), ("wheel_right_joint", (1.0, 0.0, 1.0))),
    "car": (("rear_left_wheel_joint", (1.0, 0.0, -1.0)), ("rear_right_wheel_joint", (1.0, 0.0, 1.0))),
    "omni": (
        ("front_left_wheel_joint", (1.0, -1.0, -2.0)),
        ("front_right_wheel_joint", (1.0, 1.0, 2.0)),
        ("rear_left_wheel_joint", (1.0, 1.0, -2.0)),
        ("rear_right_wheel_joint", (1.0, -1.0, 2.0)),
    ),
}


class Wheels(NamedTuple):
    """All wheels of all robots, in the order of the robots."""

    names: list[tuple[str, ...]]
    """By robot."""
    first: list[int]
    """(robots + 1): index of a robot's first wheel."""
    angles: Floats
    """(wheels): radians since the start."""
    rates: Floats
    """(wheels): rad/s."""


def make_bases(robots: Sequence[Robot]) -> tuple[Bases, Wheels]:
    """Bases and wheels of the robots, at rest. Only omni drives go sideways; without limits acceleration has none."""
    limits = np.zeros((4, len(robots), 3))
    rows: list[tuple[float, float, float]] = []
    owner: list[int] = []
    for i, robot in enumerate(robots):
        limits[:2, i] = np.transpose((robot.velocity.x, robot.velocity.y, robot.velocity.yaw))
        if robot.drive != "omni":
            limits[:2, i, 1] = 0.0
        given = robot.acceleration
        limits[2:, i] = np.transpose((given.x, given.y, given.yaw) if given else ((-math.inf, math.inf),) * 3)
        radius, half = robot.wheel_radius, 0.5 * robot.wheel_separation
        rows += [(vx / radius, vy / radius, w * half / radius) for _, (vx, vy, w) in _JOINTS[robot.drive]]
        owner += [i] * len(_JOINTS[robot.drive])
    bases = Bases(
        limits,
        np.array([robot.drive == "car" for robot in robots], bool),
        np.array([robot.wheelbase for robot in robots], float),
        np.array([robot.pose for robot in robots], float).reshape(-1, 3),
        np.array(owner, np.int64),
        np.array(rows, float).reshape(-1, 3),
    )
    names = [tuple(name for name, _ in _JOINTS[robot.drive]) for robot in robots]
    first = np.cumsum([0, *map(len, names)]).tolist()
    return bases, Wheels(names, first, bases.angles, bases.rates)


def keep_what_is_left(is_car: NDArray[np.bool_], met: NDArray[np.bool_], velocity: Floats, setpoint: Floats) -> None:
    """Of the `setpoint` of robots that `met` something keep what they made of it, their `velocity`; both (robots, 3).

    So a robot that comes free gathers speed from there. A contact takes speed away and never adds any: what pushes a
    robot does not drive it. A car's turn shrinks with its speed.
    """
    told = setpoint[met]
    made = np.clip(velocity[met], np.minimum(told, 0.0), np.maximum(told, 0.0))
    cars = is_car[met] & (told[:, 0] != 0.0)
    made[cars, 2] = told[cars, 2] * made[cars, 0] / told[cars, 0]
    setpoint[met] = made
