"""The slots of formations: where they lie, how they are squeezed, and who keeps which."""

import math
from itertools import combinations
from typing import get_args

import pytest
from hypothesis import given
from hypothesis import strategies as st

from support.flat_floor import LASER, Segment, cast, make_scan
from zteam.behaviors import load_behavior
from zteam.geometry import Pose2
from zteam.robot.behaviors.formation import (
    CLOSING,
    OPENING,
    Shape,
    Slot,
    approach,
    reassign,
    share_for_bend,
    slots_of,
    squeeze,
)
from zteam.robot.behaviors.row import share_for_room
from zteam.testing import make_view

LEADER = Slot(0.0, 0.0)
shapes = st.sampled_from(get_args(Shape))
counts = st.integers(1, 12)
spacings = st.floats(0.5, 5.0)


def nearest(slots: list[Slot]) -> float:
    """Least distance between two slots or a slot and the leader."""
    return min((math.dist(a, b) for a, b in combinations([LEADER, *slots], 2)), default=math.inf)


@given(shapes, counts, spacings)
def test_neighbours_keep_their_spacing(shape: Shape, count: int, spacing: float) -> None:
    """There is a slot for each follower, none ahead of the leader, the foremost first, and two are a spacing apart."""
    slots = slots_of(shape, count, spacing)
    assert len(slots) == count
    assert nearest(list(slots)) >= spacing - 1e-6
    assert all(slot.back >= -1e-9 for slot in slots)
    assert [round(slot.back, 6) for slot in slots] == sorted(round(slot.back, 6) for slot in slots)
    if count > 1:
        others = [min(math.dist(slot, other) for other in (LEADER, *slots) if other is not slot) for slot in slots]
        assert max(others) <= 1.5 * spacing


@pytest.mark.parametrize(
    ("shape", "expected"),
    [
        ("line", [(0, 1), (0, -1), (0, 2), (0, -2)]),
        ("column", [(1, 0), (2, 0), (3, 0), (4, 0)]),
        ("wedge", [(0.707, 0.707), (0.707, -0.707), (1.414, 1.414), (1.414, -1.414)]),
        ("diamond", [(1, 1), (1, -1), (2, 0.5), (2, -0.5)]),
        ("circle", [(0.588, 0.809), (0.588, -0.809), (1.539, 0.5), (1.539, -0.5)]),
    ],
)
def test_the_slots_of_four_followers(shape: Shape, expected: list[tuple[float, float]]) -> None:
    """Each shape as the page describes it, a metre apart."""
    for slot in slots_of(shape, 4, 1.0):
        assert min(math.dist(slot, place) for place in expected) < 1e-3
    assert len(expected) == 4


@given(shapes, counts, st.floats(0.0, 1.0))
def test_a_squeezed_formation_keeps_its_robots_apart(shape: Shape, count: int, share: float) -> None:
    """On the way from its shape to the column no two slots come much nearer than a spacing, nor to the leader."""
    slots = [squeeze(slot, rank, 1.0, share) for rank, slot in enumerate(slots_of(shape, count, 1.0))]
    assert nearest(slots) >= 0.89


@given(shapes, counts)
def test_the_ends_of_a_squeeze(shape: Shape, count: int) -> None:
    """Without a squeeze the slots are those of the shape; with a whole one they are those of the column."""
    slots = slots_of(shape, count, 0.8)
    assert [squeeze(slot, rank, 0.8, 0.0) for rank, slot in enumerate(slots)] == list(slots)
    whole = [squeeze(slot, rank, 0.8, 1.0) for rank, slot in enumerate(slots)]
    assert [pytest.approx(slot, abs=1e-9) for slot in whole] == list(slots_of("column", count, 0.8))


HERE = [Pose2(0.0, 0.0, 0.0)]


def corridor(width: float, x0: float = -5.0, x1: float = 5.0) -> list[Segment]:
    """Two walls along x."""
    return [(x0, side * width / 2.0, x1, side * width / 2.0) for side in (-1.0, 1.0)]


def share(walls: list[Segment], reach: float = 1.0, others: list[tuple[float, float]] | None = None) -> float:
    """The share that slots `reach` metres to either side need, for robots 0.35 m wide."""
    discs = others or []
    scan = make_scan(cast(LASER, walls, discs))
    return share_for_room(scan, HERE, discs, reach, reach, 0.175)


def test_it_closes_faster_than_it_opens() -> None:
    """Each at its rate, and neither beyond what is needed."""
    assert approach(0.0, 1.0, 0.1) == pytest.approx(0.1 * CLOSING)
    assert approach(0.79, 0.8, 0.1) == 0.8
    assert approach(0.8, 0.0, 0.1) == pytest.approx(0.8 - 0.1 * OPENING)
    assert approach(0.505, 0.5, 0.1) == 0.5
    assert OPENING < CLOSING


def test_a_corridor_takes_its_share() -> None:
    """Wide enough: none. Narrower: as much as the walls take. Narrower than a robot: all of it. A column: none."""
    assert share(corridor(4.0)) == 0.0
    assert share(corridor(1.55)) == pytest.approx(0.5, abs=0.01)
    assert share(corridor(0.4)) == 1.0
    assert share(corridor(0.4), reach=0.0) == 0.0


def test_walls_behind_and_far_ahead_do_not_count() -> None:
    """A passage that begins beyond two metres is not there yet, and one that it has passed is no more."""
    assert share(corridor(1.0, 2.0, 5.0)) == 0.0
    assert share(corridor(1.0, 1.0, 5.0)) > 0.5
    assert share(corridor(1.0, -5.0, -1.0)) == 0.0


def test_teammates_are_no_walls() -> None:
    """The robots of the formation themselves, beside it, take no room."""
    assert share([(50.0, 50.0, 51.0, 50.0)], others=[(0.0, 0.6), (0.5, -0.6)]) == 0.0


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_bend_squeezes_its_inner_side(side: float) -> None:
    """The slots within the bend stay well within its radius; those outside it do not count."""
    left, right = (1.6, 0.0) if side > 0.0 else (0.0, 1.6)
    assert share_for_bend(side / 4.0, left, right) == 0.0
    tight = share_for_bend(side / 1.0, left, right)
    assert (1.0 - tight) * 1.6 == pytest.approx(0.9)
    assert share_for_bend(-side / 1.0, left, right) == 0.0


SLOTS = [(0.0, 0.0), (1.0, 0.0)]


def test_slots_change_hands_only_where_that_helps_much() -> None:
    """Two robots that stand nearly as well do not swap, and robots that have passed each other do."""
    here = {1: (0.0, 0.0), 2: (1.0, 0.0)}
    slots = reassign({}, here, SLOTS)
    assert slots == {1: 0, 2: 1}
    assert reassign(slots, {1: (0.55, 0.0), 2: (0.5, 0.0)}, SLOTS) == slots
    assert reassign(slots, {1: (1.0, 0.0), 2: (0.0, 0.0)}, SLOTS) == {1: 1, 2: 0}
    assert reassign(slots, {3: (0.2, 0.0), **here}, [*SLOTS, (2.0, 0.0)]) == {1: 0, 2: 2, 3: 1}


def test_it_looks_at_the_same_times_in_all_robots() -> None:
    """Twice a second by the clock, whenever it has looked last: robots that have passed each other swap then."""
    places = {0: (3.0, 0.0, 0.0), 1: (2.5, 0.8, 0.0), 2: (2.5, -0.8, 0.0)}
    swapped = {**places, 1: places[2], 2: places[1]}
    behavior = load_behavior("formation", {"leader": 0, "shape": "line", "team": [1, 2]}, 1)

    def turn(now: float, poses: dict[int, tuple[float, float, float]]) -> float:
        return behavior.step(make_view([30.0] * 91, robot_id=1, poses=poses, now=now)).angular.z

    assert turn(1.4, places) == turn(1.45, places)
    assert turn(1.49, swapped) > turn(1.5, swapped)
