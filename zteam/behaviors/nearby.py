"""The teammates near a robot.

A look-up costs a few microseconds, and a team may have dozens of robots. So a teammate that is far away is looked up
again only when it may have come near.
"""

import math
from collections.abc import Mapping

from zteam.base import Base
from zteam.behaviors.view import View
from zteam.clock import to_ns

REACH = 5.0
"""Metres from base to base that are near."""
CLOSING = 2.0
"""m/s: two robots come no faster towards each other."""
LOOK_AGAIN = to_ns(1.0)
"""Nanoseconds until a teammate is looked up again that has no pose."""


def cannot_meet_before(now: int, away: float) -> int:
    """The time (ns) before which two robots that are `away` metres too far apart cannot be near."""
    return now + to_ns(max(0.0, away) / CLOSING)


class Nearby:
    """Knows which teammates of one robot may be near."""

    def __init__(self) -> None:
        self._sources: tuple[Mapping[int, Base], tuple[int, ...]] | tuple[None, None] = (None, None)
        """What the ids came from."""
        self._due: dict[int, int] = {}
        """Time at which each teammate is looked up again (ns)."""
        self._first_due = 0
        """The first of these times."""

    def find(self, view: View) -> set[int]:
        """The ids of those within REACH."""
        if self._sources[0] is not view.bases or self._sources[1] != view.team:
            self._sources = view.bases, view.team
            ids = {*view.bases, *view.team} - {view.robot_id}
            self._due, self._first_due = {robot: self._due.get(robot, 0) for robot in sorted(ids)}, 0
        if view.now < self._first_due:
            return set()
        found = {robot for robot, due in self._due.items() if due <= view.now and self._look(view, robot)}
        self._first_due = min(self._due.values(), default=view.now)
        return found

    def _look(self, view: View, robot: int) -> bool:
        at = view.base_from_robot(robot)
        if at is None or not (math.isfinite(at[0].x) and math.isfinite(at[0].y)):
            self._due[robot] = view.now + LOOK_AGAIN
            return False
        away = math.hypot(at[0].x, at[0].y) - REACH
        self._due[robot] = cannot_meet_before(view.now, away)
        return away <= 0.0
