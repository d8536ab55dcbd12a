"""The teammates near a robot.

A look-up costs a few microseconds, and a team may have dozens of robots. So a teammate is looked up again only when it
may have come near, or may have gone.
"""

import math
from collections.abc import Mapping
from heapq import heappop, heappush

from zteam import names
from zteam.base import Base
from zteam.behaviors.view import View
from zteam.clock import to_ns
from zteam.geometry import Pose2

REACH = 5.0
"""Metres from base to base that are near."""
CLOSING = 2.0
"""m/s: two robots come no faster towards each other, or away from each other."""
LOOK_AGAIN = to_ns(1.0)
"""Nanoseconds until a teammate is looked up again that has no pose."""


def cannot_meet_before(now: int, away: float) -> int:
    """The time (ns) before which two robots that are `away` metres too far apart cannot be near."""
    return now + to_ns(max(0.0, away) / CLOSING)


class Nearby:
    """Knows which teammates of one robot are near."""

    def __init__(self) -> None:
        self._sources: tuple[Mapping[int, Base], tuple[int, ...]] | tuple[None, None] = (None, None)
        """What the ids came from."""
        self._near: frozenset[int] = frozenset()
        self._due: list[tuple[int, int]] = []
        """A heap: when each teammate is looked up again (ns), because it may have come near or gone; and its id."""

    def find(self, view: View) -> frozenset[int]:
        """The ids of those within REACH. Mostly this compares one number."""
        if self._sources[0] is not view.bases or self._sources[1] != view.team:
            self._take_ids(view)
        due, asked = self._due, []
        while due and due[0][0] <= view.now:
            asked.append(heappop(due)[1])
        if asked:
            own = view.map_from_base()
            near = [robot for robot in asked if self._look(view, robot, None if own is None else own[0])]
            self._near = self._near.difference(asked).union(near)
        return self._near

    def _take_ids(self, view: View) -> None:
        self._sources = view.bases, view.team
        known = {robot: due for due, robot in self._due}
        ids = {*view.bases, *view.team} - {view.robot_id}
        self._due = sorted((known.get(robot, 0), robot) for robot in ids)
        self._near = self._near & ids

    def _look(self, view: View, robot: int, own: Pose2 | None) -> bool:
        """Look a teammate up; whether it is near the `own` pose in `map`."""
        at = view.lookup(names.MAP_FRAME, names.robot_frame(robot, names.BASE_FOOTPRINT))
        away = math.inf if own is None or at is None else math.hypot(at[0].x - own.x, at[0].y - own.y) - REACH
        is_known = math.isfinite(away)
        heappush(self._due, (cannot_meet_before(view.now, abs(away)) if is_known else view.now + LOOK_AGAIN, robot))
        return away <= 0.0
