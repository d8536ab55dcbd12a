"""Tables for people."""

from zteam.cli.behaviors import limits_text, value_text
from zteam.cli.tables import format_table


def test_columns_are_as_wide_as_their_widest_cell() -> None:
    """Cells are aligned, also below a longer header; no line ends with blanks."""
    assert (
        format_table(("name", "value"), [("a", "1"), ("longer", "")], "  ") == "  name    value\n  a       1\n  longer"
    )


def test_columns_of_numbers_align_right() -> None:
    """From the given column on, cells and headings end at one place; before it they begin at one place."""
    shown = format_table(("key", "type", "rate"), [("a", "Bool", "9.9 Hz"), ("longer", "x", "-")], numbers_from=2)
    assert shown.splitlines() == ["key     type    rate", "a       Bool  9.9 Hz", "longer  x          -"]


def test_a_long_last_column_is_wrapped() -> None:
    """On a terminal a text that would run over its edge goes on below its column; elsewhere it is one line."""
    rows = [("wander", "Forward while the way is free, else a turn."), ("x", "")]
    shown = format_table(("behaviour", "does"), rows, " ", width=36)
    assert shown.splitlines() == [
        " behaviour  does",
        " wander     Forward while the way is",
        "            free, else a turn.",
        " x",
    ]
    assert len(format_table(("behaviour", "does"), rows).splitlines()) == 3
    assert len(format_table(("behaviour", "does"), rows, width=20).splitlines()) == 3


def test_limits_are_words() -> None:
    """A range where both ends are known, else each limit in words."""
    assert limits_text({"ge": 0.0, "le": 3.141592653589793}) == "0 to 3.14159"
    assert limits_text({"gt": 0, "lt": 5}) == "above 0, below 5"
    assert limits_text({"ge": 0.0, "lt": 5.0}) == "at least 0, below 5"
    assert limits_text({"min_length": 1, "max_length": 9, "pattern": "[a-z]+"}) == (
        'at least 1 long, at most 9 long, like "[a-z]+"'
    )
    assert limits_text({}) == ""


def test_values_are_short() -> None:
    """A number has no noise digits, a text its quotes."""
    values = (1.0471975511965976, 2, True, "a b", None, [1.0, 2])
    assert [value_text(value) for value in values] == ["1.0472", "2", "true", '"a b"', "none", "[1.0, 2]"]
