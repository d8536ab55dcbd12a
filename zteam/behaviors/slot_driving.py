"""How a robot drives to its slot past the others, which are predicted straight on, and stays in it."""

import math
from collections.abc import Container, Sequence
from typing import NamedTuple

from zteam.behaviors.view import View
from zteam.geometry import Pose2, normalize_angle
from zteam.messages import Twist, Vector3

HORIZON = 2.0
"""Seconds that are predicted."""
STALE_AFTER = 1.0
"""Seconds; a robot with an older pose is not seen any more."""
SLOT_GAIN, TURN_GAIN = 2.0, 3.0
"""1/s: speed towards the slot, and turn rate."""
SPOT_ANGLE = 1.0
"""Radians: it turns on the spot towards a direction that is further off."""
STANDING = 0.02
"""m/s: what is slower stands."""
CLOSE = 0.45
"""Metres: near its slot no robot is passed nearer. In bends the inner robots come nearer to each other."""
LEAST_FORWARD = 0.05
"""m/s along the slot's heading while the slot moves."""
ALIGNED = 0.05
"""Radians to a heading from which on it does not turn."""
NEAR = 0.5
"""Metres to the slot within which it moves and turns as the slot does."""
HORIZON_OF_TURN = 1.0
"""Seconds that it looks ahead along its heading while it turns."""
_STEP = math.radians(15.0)
_CHANGES = sorted(
    # Right before left, as on a road.
    ((scale, side * step * _STEP) for scale in (1.0, 0.75, 0.5, 0.25) for step in range(7) for side in (-1.0, 1.0)),
    key=lambda change: round(1.0 + change[0] ** 2 - 2.0 * change[0] * math.cos(change[1]), 6),
)
_CANDIDATES = tuple((scale * math.cos(turn), scale * math.sin(turn)) for scale, turn in _CHANGES)
"""Turned and shorter: the least change first."""


class Other(NamedTuple):
    """Another robot in map: metres and m/s."""

    x: float
    y: float
    velocity_x: float = 0.0
    velocity_y: float = 0.0
    stamp: int = 0
    robot: int = 0

    @property
    def speed(self) -> float:
        """m/s."""
        return math.hypot(self.velocity_x, self.velocity_y)


class Others:
    """Where other robots are, and how they move: from their newest two poses."""

    def __init__(self) -> None:
        self._known: dict[int, Other] = {}

    def take(self, view: View, here: Pose2, robots: Container[int]) -> dict[int, Other]:
        """Those of the `robots` that are seen now, by id; `here` is the own pose in map."""
        found, (own_x, own_y, yaw) = {}, here
        cos, sin = math.cos(yaw), math.sin(yaw)
        for robot, pose, age, _base in view.teammates:
            if robot not in robots or age > STALE_AFTER or not all(map(math.isfinite, pose)):
                continue
            stamp, before = view.now - round(age * 1e9), self._known.get(robot)
            if before is None or stamp > before.stamp:
                x, y = own_x + cos * pose.x - sin * pose.y, own_y + sin * pose.x + cos * pose.y
                rate = 0.0 if before is None else 1e9 / (stamp - before.stamp)
                moved_x, moved_y = (0.0, 0.0) if before is None else (x - before.x, y - before.y)
                before = Other(x, y, rate * moved_x, rate * moved_y, stamp, robot)
            found[robot] = before
        self._known = found
        return found


class Target(NamedTuple):
    """A slot now, in map."""

    pose: Pose2
    speed: float
    """m/s along its heading."""
    turn: float
    """rad/s."""


def drive_to(
    here: Pose2, target: Target, others: Sequence[Other], room: float, max_linear: float, max_angular: float
) -> tuple[Twist, int | None]:
    """The velocity that takes the slot's motion and closes the distance to it, and the robot that it waits for.

    No other robot is passed nearer than `room` (m). Poses are in map.
    """
    x, y = target.pose.x - here.x, target.pose.y - here.y
    distance = math.hypot(x, y)
    cos, sin = math.cos(target.pose.yaw), math.sin(target.pose.yaw)
    pull = min(SLOT_GAIN, max_linear / max(distance, 1e-9))
    forward, side = target.speed + pull * (cos * x + sin * y), pull * (cos * y - sin * x)
    if target.speed > STANDING:
        # A robot ahead of its slot waits for it and does not turn back.
        forward = max(forward, LEAST_FORWARD)
    # Once it is in its slot it moves with the others.
    soon = min(HORIZON, distance / max(math.hypot(forward - target.speed, side), STANDING))
    wanted = cos * forward - sin * side, sin * forward + cos * side
    close = min(room, CLOSE)
    x, y = give_way(here, *wanted, others, room if distance > NEAR else close, soon)
    if math.hypot(x, y) < STANDING:
        return Twist(), meets(here, *wanted, others, room, soon)
    command = steer(x, y, here.yaw, target.turn if distance < NEAR else 0.0, max_linear, max_angular)
    # Its heading may still be another one than that of the velocity, which passes them.
    ahead = command.linear.x * math.cos(here.yaw), command.linear.x * math.sin(here.yaw)
    blocker = meets(here, *ahead, others, close, HORIZON_OF_TURN)
    return (command, None) if blocker is None else (Twist(angular=command.angular), blocker)


def steer(x: float, y: float, yaw: float, turn: float, max_linear: float, max_angular: float) -> Twist:
    """The unicycle's command for a velocity (m/s, in map) and a turn rate besides (rad/s)."""
    angle = normalize_angle(math.atan2(y, x) - yaw)
    speed = min(math.hypot(x, y), max_linear) * math.cos(angle) if abs(angle) < SPOT_ANGLE else 0.0
    return Twist(Vector3(speed), Vector3(z=_limit(TURN_GAIN * angle + turn, max_angular)))


def turn_to(angle: float, max_angular: float) -> Twist:
    """Turn on the spot by this angle (rad)."""
    angle = normalize_angle(angle)
    return Twist(angular=Vector3(z=0.0 if abs(angle) < ALIGNED else _limit(TURN_GAIN * angle, max_angular)))


def _limit(turn: float, most: float) -> float:
    return max(-most, min(most, turn))


def give_way(
    here: Pose2, x: float, y: float, others: Sequence[Other], distance: float, horizon: float = HORIZON
) -> tuple[float, float]:
    """The velocity (x, y) or the least change of it with which no other comes nearer than `distance`; else zero.

    `here` and the velocity (m/s) are in map. Motion is predicted for `horizon` seconds.
    """
    for cos, sin in _CANDIDATES:
        turned = cos * x - sin * y, sin * x + cos * y
        if meets(here, *turned, others, distance, horizon) is None:
            return turned
    return 0.0, 0.0


def meets(
    here: Pose2, x: float, y: float, others: Sequence[Other], distance: float, horizon: float = HORIZON
) -> int | None:
    """The first that comes nearer than `distance` within the horizon; one that is nearer must not come nearer."""
    for other in others:
        off_x, off_y, closing_x, closing_y = other.x - here.x, other.y - here.y, x - other[2], y - other[3]
        closing = off_x * closing_x + off_y * closing_y
        square = closing_x * closing_x + closing_y * closing_y
        # The square of a velocity that is next to nothing is 0.
        if closing <= 0.0 or not square:
            continue
        when = min(closing / square, horizon)
        if math.hypot(off_x - when * closing_x, off_y - when * closing_y) < distance:
            return other.robot
    return None
