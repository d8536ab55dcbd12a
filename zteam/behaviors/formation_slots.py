"""Which robot of a formation has which slot: the same for all robots that compute it from the same poses."""

import math
from collections.abc import Mapping, Sequence

from zteam.behaviors.assignment import assign

_PERIOD = 500_000_000
"""Nanoseconds between two looks for a better assignment: at the same times in all robots."""
_BETTER = 0.7
"""A new assignment costs at most this share of the present one: so slots do not flip where two cost nearly the same."""


class Assignment:
    """The slots of the members of one formation, by robot id."""

    def __init__(self) -> None:
        self._slots: dict[int, int] = {}
        self._looked = -1

    def forget(self) -> None:
        """Assign anew at the next look."""
        self._slots = {}

    def slot_of(self, robot: int) -> int | None:
        """The number of a member's slot; None for a robot that has none."""
        return self._slots.get(robot)

    def is_due(self, now: int, members: Mapping[int, object]) -> bool:
        """Whether to look at time `now` (ns): when members have come or gone, and from time to time."""
        return self._slots.keys() != members.keys() or now // _PERIOD != self._looked

    def look(self, now: int, members: Mapping[int, Sequence[float]], places: Sequence[tuple[float, float]]) -> None:
        """Assign the slots at these places (as many as members) with the least sum of squared distances.

        Straight ways to slots that are assigned so do not cross.
        """
        self._looked = now // _PERIOD
        robots = sorted(members)
        costs = [[math.dist(members[robot], place) ** 2 for place in places] for robot in robots]
        best = assign(costs)
        if self._slots.keys() == members.keys():
            present = sum(costs[row][self._slots[robot]] for row, robot in enumerate(robots))
            if sum(costs[row][column] for row, column in enumerate(best)) > _BETTER * present:
                return
        self._slots = dict(zip(robots, best, strict=True))
