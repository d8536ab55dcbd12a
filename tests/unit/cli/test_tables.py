"""Tables for people."""

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
