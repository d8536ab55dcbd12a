"""The grammar of robot ids, for lists that a user may write in many ways."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from zteam.config.robot_ids import format_robot_ids, parse_robot_ids
from zteam.errors import UsageError
from zteam.names import MAX_ROBOT_ID

id_sets = st.sets(st.integers(0, 40) | st.integers(0, MAX_ROBOT_ID), min_size=1, max_size=30)
separators = st.sampled_from([" ", ",", ", ", " ,", "  ", "\t"])
broken_items = st.sampled_from(
    ["", "-", "1-", "-1", "1-2-3", "3-1", "a", "1.5", "²", "٣", "10000", "0-10000", "9" * 400]
)


@st.composite
def written_ids(draw: st.DrawFn) -> tuple[str, list[int]]:
    """A text of ids and ranges with mixed separators, and the ids that it names in their order."""
    ids = draw(id_sets)
    items, named = [], []
    left = sorted(ids)
    while left:
        run = 1
        while run < len(left) and left[run] == left[0] + run and draw(st.booleans()):
            run += 1
        items.append((left[0], left[run - 1]))
        left = left[run:]
    text = ""
    for first, last in draw(st.permutations(items)):
        text += (draw(separators) if text else "") + (f"{first}-{last}" if first < last else str(first))
        named += range(first, last + 1)
    return text, named


@given(written_ids())
def test_every_way_to_write_ids_names_them(written: tuple[str, list[int]]) -> None:
    """Single ids and ranges, with commas and spaces, are read in the order in which they stand; a shell may split the
    text."""
    text, named = written
    assert list(parse_robot_ids([text], "--ids")) == list(parse_robot_ids(text.split(), "--ids")) == named


@given(id_sets)
def test_formatted_ids_are_read_again(ids: set[int]) -> None:
    """What `format_robot_ids` writes is in the grammar, and names the sorted ids."""
    assert list(parse_robot_ids([format_robot_ids(ids)], "--ids")) == sorted(ids)


@given(written_ids(), broken_items, st.sampled_from([",", ", "]), st.booleans())
def test_one_broken_item_refuses_the_whole(
    written: tuple[str, list[int]], broken: str, separator: str, first: bool
) -> None:
    """A text with one item that is no id and no range is refused, on one short line that names the place."""
    text = broken + separator + written[0] if first else written[0] + separator + broken
    with pytest.raises(UsageError) as caught:
        parse_robot_ids([text], "--ids")
    told = str(caught.value)
    assert told.startswith("--ids: ")
    assert repr(broken[:20])[:-1] in told
    assert "\n" not in told
    assert len(told) < 120


@given(written_ids(), st.data())
def test_an_id_that_comes_twice_is_refused(written: tuple[str, list[int]], data: st.DataObject) -> None:
    """A second mention, also inside a range, names the id."""
    text, named = written
    again = data.draw(st.sampled_from(named))
    with pytest.raises(UsageError, match=f"^--ids names a robot twice: {again}$"):
        parse_robot_ids([text, str(again)], "--ids")


@given(st.lists(st.text(st.characters(codec="utf-8"), max_size=12), max_size=4))
def test_any_text_is_read_or_refused(words: list[str]) -> None:
    """No text makes another error than UsageError, and what is read is within the bounds and without repetition."""
    try:
        ids = parse_robot_ids(words, "--ids")
    except UsageError as error:
        assert str(error).startswith("--ids")
    else:
        assert ids
        assert len(set(ids)) == len(ids)
        assert all(0 <= robot_id <= MAX_ROBOT_ID for robot_id in ids)
