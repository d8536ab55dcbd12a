"""Ids of several robots, as users type them; the grammar is a property as well."""

import pytest

from zteam.config.robot_ids import circle_from, format_robot_ids, parse_robot_ids
from zteam.errors import UsageError


def test_ids_ranges_commas_and_spaces_mix() -> None:
    """Zeros in front do not count, and the order stays."""
    assert parse_robot_ids(["5,", "007", " 0 2-4 "], "--ids") == (5, 7, 0, 2, 3, 4)


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["3-1"], "--ids: '3-1': the first id is above the last"),
        (["9" * 5000], f"--ids: '{'9' * 24}…': give robot ids from 0 to 9999, such as 0 2 5, 0-3 or 0,2-4"),
        ([""], "--ids: no id is given: give robot ids such as 0 2 5, 0-3 or 0,2-4"),
        # At once, although the list is long.
        (["0-9999"] * 100_000, "--ids names a robot twice: 0"),
    ],
)
def test_mistakes_are_named(words: list[str], text: str) -> None:
    """The error names the place and the item, and says what to type."""
    with pytest.raises(UsageError) as caught:
        parse_robot_ids(words, "--ids")
    assert str(caught.value) == text


@pytest.mark.parametrize(
    ("ids", "text"),
    [([], ""), ([3], "3"), ([1, 0], "0, 1"), ([2, 1, 0], "0-2"), ([0, 1, 2, 3, 7, 8, 10], "0-3, 7, 8, 10")],
)
def test_ids_are_listed_short(ids: list[int], text: str) -> None:
    """Three or more that follow each other are a range."""
    assert format_robot_ids(ids) == text


def test_robots_that_follow_each_other_in_a_circle_are_found() -> None:
    """A robot that follows one of a circle is no part of it."""
    leaders = {0: None, 1: 2, 2: 3, 3: 1, 4: 1}
    assert [circle_from(robot_id, leaders) for robot_id in (0, 1, 4)] == [[], [1, 2, 3, 1], []]
