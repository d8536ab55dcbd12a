"""Ids of several robots, as users type them."""

import pytest

from zteam.config.robot_ids import format_robot_ids, parse_robot_ids
from zteam.errors import UsageError


@pytest.mark.parametrize(
    ("words", "ids"),
    [
        (["0", "1", "2", "3"], (0, 1, 2, 3)),
        (["0-3"], (0, 1, 2, 3)),
        (["0,2-4"], (0, 2, 3, 4)),
        (["0", "2-4"], (0, 2, 3, 4)),
        (["0,", "2"], (0, 2)),
        (["5", "0"], (5, 0)),
        (["7-7"], (7,)),
        (["007"], (7,)),
        ([" 0 2-4 "], (0, 2, 3, 4)),
    ],
)
def test_the_grammar(words: list[str], ids: tuple[int, ...]) -> None:
    """Single ids, ranges, commas and spaces mix."""
    assert parse_robot_ids(words, "--ids") == ids


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["3-1"], "--ids: '3-1': the first id is above the last"),
        (["0", "abc"], "--ids: 'abc': give robot ids from 0 to 9999, such as 0 2 5, 0-3 or 0,2-4"),
        (["0-10000"], "--ids: '0-10000': give robot ids from 0 to 9999, such as 0 2 5, 0-3 or 0,2-4"),
        (["0,,1"], "--ids: '': give robot ids from 0 to 9999, such as 0 2 5, 0-3 or 0,2-4"),
        (["0-3", "2"], "--ids names a robot twice: 2"),
        ([], "--ids: no id is given: give robot ids such as 0 2 5, 0-3 or 0,2-4"),
        ([""], "--ids: no id is given: give robot ids such as 0 2 5, 0-3 or 0,2-4"),
        (["9" * 5000], f"--ids: '{'9' * 24}…': give robot ids from 0 to 9999, such as 0 2 5, 0-3 or 0,2-4"),
    ],
)
def test_mistakes_are_named(words: list[str], text: str) -> None:
    """The error names the place and the item, and says what to type."""
    with pytest.raises(UsageError) as caught:
        parse_robot_ids(words, "--ids")
    assert str(caught.value) == text


def test_repeated_ranges_are_refused_at_once() -> None:
    """The list never grows beyond the bound of ids, however often a range is written."""
    with pytest.raises(UsageError, match="twice: 0"):
        parse_robot_ids(["0-9999"] * 100_000, "--ids")


@pytest.mark.parametrize(
    ("ids", "text"),
    [([], ""), ([3], "3"), ([1, 0], "0, 1"), ([2, 1, 0], "0-2"), ([0, 1, 2, 3, 7, 8, 10], "0-3, 7, 8, 10")],
)
def test_ids_are_listed_short(ids: list[int], text: str) -> None:
    """Three or more that follow each other are a range."""
    assert format_robot_ids(ids) == text
