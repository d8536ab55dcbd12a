"""The shapes of formations: where each follower's slot lies, seen from the leader.

A slot lies so far back along the leader's trail, and so far to the left of it. So a formation goes round a bend as a
train does, and does not swing outwards like a board.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from functools import lru_cache
from itertools import combinations
from typing import Literal, NamedTuple, get_args

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
