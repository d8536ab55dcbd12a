"""Which robot of a formation takes which slot: the cheapest assignment, the same for all robots that compute it."""

import math
from collections.abc import Mapping, Sequence


def assign(costs: Sequence[Sequence[float]]) -> list[int]:
    """The column of each row in the cheapest assignment of a square table of costs: always the same; n³ steps."""
    count = len(costs)
    row_prices, column_prices = [0.0] * (count + 1), [0.0] * (count + 1)
    # Rows and columns count from 1 here; column 0 holds the row that has no column yet.
    row_of = [0] * (count + 1)
    for row in range(1, count + 1):
        row_of[0] = row
        # The free column at the end of the cheapest chain of changes, and the column before each one in such chains.
        column, before, slack, is_used = 0, [0] * (count + 1), [math.inf] * (count + 1), [False] * (count + 1)
        while row_of[column]:
            is_used[column] = True
            chosen, least, nearest = row_of[column], math.inf, 0
            for other in range(1, count + 1):
                if is_used[other]:
                    continue
                cost = costs[chosen - 1][other - 1] - row_prices[chosen] - column_prices[other]
                if cost < slack[other]:
                    slack[other], before[other] = cost, column
                if slack[other] < least:
                    least, nearest = slack[other], other
            for other in range(count + 1):
                if is_used[other]:
                    row_prices[row_of[other]] += least
                    column_prices[other] -= least
                else:
                    slack[other] -= least
            column = nearest
        while column:
            row_of[column] = row_of[before[column]]
            column = before[column]
    columns = [0] * count
    for column, row in enumerate(row_of[1:]):
        columns[row - 1] = column
    return columns


_PERIOD = 500_000_000
"""Nanoseconds between two looks for a better assignment: at the same times in all robots."""
_BETTER = 0.7
"""A new assignment costs at most this share of the present one: so slots do not flip where two cost nearly the same."""


class Assignment:
    """The slots of the members of one formation, by robot id."""

    def __init__(self) -> None:
        self.slots: dict[int, int] = {}
        """The number of each member's slot."""
        self._looked = -1

    def is_due(self, now: int, members: Mapping[int, object]) -> bool:
        """Whether to look at time `now` (ns): when members have come or gone, and from time to time."""
        return self.slots.keys() != members.keys() or now // _PERIOD != self._looked

    def look(self, now: int, members: Mapping[int, Sequence[float]], places: Sequence[tuple[float, float]]) -> None:
        """Assign the slots at these places, one a member: least squared distances, so straight ways do not cross."""
        self._looked = now // _PERIOD
        robots = sorted(members)
        costs = [[math.dist(members[robot], place) ** 2 for place in places] for robot in robots]
        best = assign(costs)
        if self.slots.keys() == members.keys():
            present = sum(costs[row][self.slots[robot]] for row, robot in enumerate(robots))
            if sum(costs[row][column] for row, column in enumerate(best)) > _BETTER * present:
                return
        self.slots = dict(zip(robots, best, strict=True))
