"""What a base makes of its commands: velocities within its limits."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

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


def obey(drives: Drives, commands: Floats, fresh: NDArray[np.bool_], seconds: float, setpoint: Floats) -> Floats:
    """What `setpoint` (robots, 3) becomes: it goes towards `commands` (robots, 3) as far as the limits allow in
    `seconds`, and towards 0 where the command is not `fresh`.

    A car's angular command is Stage's: the angle of the steered wheels, v sin(angle) / wheelbase the yaw rate. While a
    car gathers or loses speed it turns no more sharply than its wheels are steered.
    """
    goal, cars = commands.copy(), drives.is_car
    if cars.any():
        speed, angle = commands[cars, 0], commands[cars, 2]
        goal[cars, 0], goal[cars, 2] = speed * np.cos(angle), speed * np.sin(angle) / drives.wheelbase[cars]
    goal = np.clip(goal, drives.low, drives.high)
    goal[~fresh] = 0.0
    made = np.clip(goal, setpoint + drives.slow * seconds, setpoint + drives.fast * seconds)
    if cars.any():
        # Yaw rate over speed, as commanded; while a car comes to a stand, as it was.
        steered = np.where(goal[cars, :1] != 0.0, goal[cars], setpoint[cars])
        bend = np.abs(np.divide(steered[:, 2], steered[:, 0], out=np.zeros(len(steered)), where=steered[:, 0] != 0.0))
        most = bend * np.abs(made[cars, 0]) * (1.0 + 1e-12)
        made[cars, 2] = np.clip(made[cars, 2], -most, most)
    return made


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
