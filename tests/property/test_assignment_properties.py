"""Assignments of robots to slots."""

from itertools import permutations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from zteam.robot.behaviors.formation import assign, reassign

costs = st.integers(0, 6).flatmap(
    lambda n: st.lists(
        st.lists(st.floats(0.0, 1e6) | st.integers(0, 3).map(float), min_size=n, max_size=n), min_size=n, max_size=n
    )
)
places = st.tuples(st.floats(-50.0, 50.0), st.floats(-50.0, 50.0))


@given(costs)
def test_no_other_assignment_is_cheaper(table: list[list[float]]) -> None:
    """Every row gets a column of its own, and no permutation costs less."""
    found = assign(table)
    rows = range(len(table))
    assert sorted(found) == list(rows)
    best = min(sum(table[row][column] for row, column in zip(rows, way, strict=True)) for way in permutations(rows))
    assert sum(table[row][found[row]] for row in rows) == pytest.approx(best, rel=1e-9, abs=1e-6)


@given(st.lists(st.tuples(places, places), min_size=1, max_size=6), st.randoms())
def test_all_robots_assign_alike(pairs: list[tuple[tuple[float, float], tuple[float, float]]], random: object) -> None:
    """The order in which a robot came to know the others does not matter."""
    members = {robot: robot_at for robot, (robot_at, _) in enumerate(pairs)}
    slots = [slot_at for _, slot_at in pairs]
    shuffled = list(members)
    random.shuffle(shuffled)  # type: ignore[attr-defined]
    again = {robot: members[robot] for robot in shuffled}
    assert reassign({}, members, slots) == reassign({}, again, slots)
