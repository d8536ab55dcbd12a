"""The slots of formations: where they lie behind the leader, how far they are squeezed, and which robot takes which.

A slot lies so far back along the leader's trail, and so far to the left of it. So a formation goes round a bend as a
train does, and does not swing outwards like a board. It is squeezed to a column where walls are near, and where it
goes round a tight bend.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import lru_cache
from itertools import combinations
from typing import Literal, NamedTuple, get_args

import numpy as np

from zteam.geometry import Pose2
from zteam.messages import LaserScan
from zteam.robot.scans import beams_of

Shape = Literal["line", "column", "wedge", "diamond", "circle"]
_RISE = math.sqrt(0.5)


class Slot(NamedTuple):
    """A place in a formation: metres."""

    back: float
    """Arc length behind the leader along its trail."""
    lateral: float
    """To the left of the trail."""


@lru_cache(maxsize=64)
def slots_of(shape: Shape, count: int, spacing: float) -> tuple[Slot, ...]:
    """The slots of `count` followers, the foremost first. Neighbours are about `spacing` metres apart.

    `line`: side by side with the leader in the middle. `column`: one behind the other. `wedge`: two arms that go back
    from the leader at a right angle. `diamond`: along the sides of a square that stands on the leader's corner.
    `circle`: on a circle.
    """
    return tuple(sorted(_SLOTS[shape](count, spacing), key=lambda slot: (round(slot.back, 6), abs(slot.lateral))))


def reach_of(slots: Sequence[Slot]) -> tuple[float, float]:
    """Metres that the slots reach to the left and to the right of the trail, to the micrometre."""
    laterals = [round(slot.lateral, 6) for slot in slots]
    return max((0.0, *laterals)), -min((0.0, *laterals))


def squeeze(slot: Slot, rank: int, spacing: float, share: float) -> Slot:
    """A slot moved by `share` (0 to 1) towards place `rank` (from 0) of the column.

    It is at its place along the column at a share of a half: two slots side by side come one behind the other before
    they come together.
    """
    column = (rank + 1) * spacing
    return Slot(slot.back + min(1.0, 2.0 * share) * (column - slot.back), (1.0 - share) * slot.lateral)


def _diamond(count: int, spacing: float) -> list[Slot]:
    quarter = 0.25 * (count + 1)
    slots = []
    for place in range(1, count + 1):
        # From the leader's corner along the left sides, and back along the right ones.
        along = min(place, 4.0 * quarter - place)
        lateral = min(along, 2.0 * quarter - along)
        slots.append(Slot(along, lateral if place <= 2.0 * quarter else -lateral))
    # Two neighbours with a corner between them are nearer than along the sides.
    nearest = min(math.dist(a, b) for a, b in combinations([Slot(0.0, 0.0), *slots], 2))
    return [Slot(slot.back * spacing / nearest, slot.lateral * spacing / nearest) for slot in slots]


def _circle(count: int, spacing: float) -> list[Slot]:
    step = math.tau / (count + 1)
    radius = 0.5 * spacing / math.sin(0.5 * step)
    turns = [place * step for place in range(1, count + 1)]
    return [Slot(radius * (1.0 - math.cos(turn)), radius * math.sin(turn)) for turn in turns]


def _pairs(count: int) -> Iterator[tuple[int, float]]:
    """The number of the pair and the side (1 left, -1 right) of each follower."""
    return ((place // 2 + 1, -1.0 if place % 2 else 1.0) for place in range(count))


_SLOTS: dict[Shape, Callable[[int, float], list[Slot]]] = {
    "line": lambda count, spacing: [Slot(0.0, side * pair * spacing) for pair, side in _pairs(count)],
    "column": lambda count, spacing: [Slot((place + 1) * spacing, 0.0) for place in range(count)],
    "wedge": lambda count, spacing: [
        Slot(_RISE * pair * spacing, side * _RISE * pair * spacing) for pair, side in _pairs(count)
    ],
    "diamond": _diamond,
    "circle": _circle,
}
SHAPES: tuple[Shape, ...] = get_args(Shape)


MARGIN = 0.1
"""Metres that have to be free beside the outermost robot."""
BEHIND, AHEAD = 0.5, 1.5
"""Metres along the trail, from the leader and from the own slot, within which walls count."""
BODY = 0.45
"""Metres around another robot within which a hit is that robot."""
BEND = 0.9
"""The outermost slot lies within this share of the radius of a bend."""
CLOSING, OPENING = 0.5, 0.13
"""1/s: how fast the formation closes and opens."""


def approach(share: float, needed: float, dt: float) -> float:
    """The share after `dt` seconds: it closes faster than it opens, so a doorway does not open it."""
    return min(needed, share + CLOSING * dt) if needed > share else max(needed, share - OPENING * dt)


def share_for_bend(curvature: float, left: float, right: float) -> float:
    """The share that a bend (1/m, left positive) needs for slots that reach so far (m) to the left and to the right."""
    width = abs(curvature) * (left if curvature > 0.0 else right)
    return max(0.0, 1.0 - BEND / width) if width > BEND else 0.0


def share_for_room(
    scan: LaserScan,
    places: Sequence[Pose2],
    others: Sequence[tuple[float, float]],
    left: float,
    right: float,
    half_width: float,
) -> float:
    """The share that walls beside these places of the trail need, without hits on the others. Own base frame."""
    beside = half_width + MARGIN
    # What is further to the side needs nothing.
    side = max(left, right) + beside
    bound = math.hypot(side, AHEAD) + max(math.hypot(place.x, place.y) for place in places)
    beams = beams_of(scan)
    if beams is None or beams.nearest >= bound:
        return 0.0
    hits = beams.find_hits(bound)
    for x, y in others:
        hits = hits[:, np.hypot(hits[0] - x, hits[1] - y) > BODY]
    needed = 0.0
    for x, y, yaw in places:
        dx, dy, cos, sin = hits[0] - x, hits[1] - y, math.cos(yaw), math.sin(yaw)
        along, across = cos * dx + sin * dy, cos * dy - sin * dx
        off = across[(along > -BEHIND) & (along < AHEAD) & (np.abs(across) < side)]
        for reach, offs in ((left, off[off > 0.0]), (right, -off[off < 0.0])):
            if reach > 0.0 and offs.size:
                needed = max(needed, 1.0 - (float(offs.min()) - beside) / reach)
    return min(needed, 1.0)


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
