"""How robots of a formation get past each other: predicted straight on, with a few other velocities to choose from."""

import math
from collections.abc import Container, Sequence
from typing import NamedTuple

from zteam.behaviors.view import Teammate, View
from zteam.geometry import Pose2

HORIZON = 2.0
"""Seconds that are predicted."""
STALE_AFTER = 1.0
"""Seconds; a robot with an older pose is not seen any more."""
_STEP = math.radians(15.0)
_CANDIDATES = tuple(
    (scale * math.cos(turn), scale * math.sin(turn))
    for scale, turn in sorted(
        # Right before left, as on a road.
        ((scale, side * step * _STEP) for scale in (1.0, 0.75, 0.5, 0.25) for step in range(7) for side in (-1.0, 1.0)),
        key=lambda change: round(
            math.dist((1.0, 0.0), (change[0] * math.cos(change[1]), change[0] * math.sin(change[1]))), 6
        ),
    )
)
"""Turned and shorter: the least change first."""


class Other(NamedTuple):
    """Another robot in map: metres and m/s."""

    x: float
    y: float
    velocity_x: float = 0.0
    velocity_y: float = 0.0
    stamp: int = 0

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
        self._known = {
            mate.robot_id: self._place(mate, here, view.now)
            for mate in view.teammates
            if mate.robot_id in robots and mate.age <= STALE_AFTER and all(map(math.isfinite, mate.pose))
        }
        return self._known

    def _place(self, mate: Teammate, here: Pose2, now: int) -> Other:
        x, y, _ = here.compose(mate.pose)
        stamp = now - round(mate.age * 1e9)
        before = self._known.get(mate.robot_id)
        if before is None or stamp <= before.stamp:
            return before or Other(x, y, 0.0, 0.0, stamp)
        seconds = (stamp - before.stamp) / 1e9
        return Other(x, y, (x - before.x) / seconds, (y - before.y) / seconds, stamp)


def give_way(
    here: Pose2, x: float, y: float, others: Sequence[Other], distance: float, horizon: float = HORIZON
) -> tuple[float, float]:
    """The velocity (x, y) or the least change of it with which no other comes nearer than `distance`; else zero.

    `here` and the velocity (m/s) are in map. Motion is predicted for `horizon` seconds.
    """
    around = _around(here, others)
    for cos, sin in _CANDIDATES:
        turned = cos * x - sin * y, sin * x + cos * y
        if not _meets(*turned, around, distance, horizon):
            return turned
    return 0.0, 0.0


def is_free(here: Pose2, speed: float, others: Sequence[Other], distance: float, horizon: float) -> bool:
    """Whether no other comes nearer than `distance` when it drives straight on along its heading at `speed` (m/s)."""
    x, y = speed * math.cos(here.yaw), speed * math.sin(here.yaw)
    return not _meets(x, y, _around(here, others), distance, horizon)


def _around(here: Pose2, others: Sequence[Other]) -> list[tuple[float, float, float, float]]:
    return [(other.x - here.x, other.y - here.y, other.velocity_x, other.velocity_y) for other in others]


def _meets(
    x: float, y: float, around: list[tuple[float, float, float, float]], distance: float, horizon: float
) -> bool:
    """Whether another one comes nearer than `distance` within the horizon; one that is nearer must not come nearer."""
    for other_x, other_y, velocity_x, velocity_y in around:
        closing_x, closing_y = x - velocity_x, y - velocity_y
        closing = other_x * closing_x + other_y * closing_y
        square = closing_x * closing_x + closing_y * closing_y
        # The square of a velocity that is next to nothing is 0.
        if closing <= 0.0 or not square:
            continue
        when = min(closing / square, horizon)
        if math.hypot(other_x - when * closing_x, other_y - when * closing_y) < distance:
            return True
    return False
