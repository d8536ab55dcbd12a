"""The slots of formations."""

import math
from itertools import combinations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from zteam.behaviors.shapes import SHAPES, Shape, Slot, reach_of, slots_of, squeeze

LEADER = Slot(0.0, 0.0)
shapes = st.sampled_from(SHAPES)
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


def test_a_diamond_of_three_followers_is_a_square() -> None:
    """It stands on the leader's corner."""
    slots = sorted(slots_of("diamond", 3, 1.0))
    corner = math.sqrt(0.5)
    assert [pytest.approx(slot) for slot in slots] == [(corner, -corner), (corner, corner), (2.0 * corner, 0.0)]


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


def test_how_far_a_shape_reaches() -> None:
    """To the left and to the right of the trail; a column reaches nowhere."""
    assert reach_of(slots_of("line", 3, 1.0)) == (2.0, 1.0)
    assert reach_of(slots_of("column", 3, 1.0)) == (0.0, 0.0)
