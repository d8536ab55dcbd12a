"""Single values in TOML, their text on one line, and the lines of the keys in a TOML text."""

from typing import Any

import pytest

from zteam.config.toml_values import MAX_DEPTH, TomlError, key_lines, line_of, parse_value, toml_text


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("2", 2),
        ("-0.5", -0.5),
        ("true", True),
        ('"2"', "2"),
        ("[1, 2]", [1, 2]),
        ("{a = 1}", {"a": 1}),
        ("office", "office"),
        ("1-7", "1-7"),
        ("", ""),
        # What would be more than one value is a text.
        ("1\nx = 2", "1\nx = 2"),
        ("9" * 5000, "9" * 5000),
        ("[" * 5000, "[" * 5000),
    ],
)
def test_a_value_is_toml_or_the_text_itself(text: str, value: Any) -> None:
    """Whatever is no value of TOML is a text, also where tomllib would not return."""
    assert parse_value(text) == value


@pytest.mark.parametrize("value", [2, -0.5, True, "a\x7f\n\"'é", [1, [2.5]], {"a b": {"c": "d"}}, ""])
def test_the_text_of_a_value_is_read_as_that_value(value: Any) -> None:
    """The text has one line."""
    assert "\n" not in toml_text(value)
    assert parse_value(toml_text(value)) == value


def test_what_toml_lacks_has_no_text() -> None:
    """None, and a number of more than 64 bits."""
    for value in (None, 2**63):
        with pytest.raises(TypeError):
            toml_text(value)


def test_the_nearest_line_above_is_found() -> None:
    """A missing key gets the line of the table that it belongs to."""
    lines = key_lines("[a]\nb = 1\n")
    assert line_of(lines, ("a", "c", 3)) == 1
    assert line_of(lines, ("a", "b")) == 2
    assert line_of(lines, ("x",)) is None


@pytest.mark.parametrize("ends", ["\r\n", "\n"])
def test_both_kinds_of_line_break_count(ends: str) -> None:
    """A file that was written on Windows has the same lines."""
    assert key_lines(ends.join(["# one", "a = 1", "", "[b]", "c = 2"]))["b", "c"] == 5


@pytest.mark.parametrize(
    "text",
    [
        ".".join("a" * 50_000) + " = 1",
        "x = " + "[" * 5_000,
        "x = " + "{ a = " * 5_000,
        "x = " + f"{{ {'.'.join('a' * (MAX_DEPTH - 1))} = " * (MAX_DEPTH - 1) + "1" + " }" * (MAX_DEPTH - 1),
        "[" + ".".join("a" * (MAX_DEPTH + 1)) + "]",
        "[a.b]\n" + ".".join("c" * (MAX_DEPTH - 1)) + " = 1",
    ],
)
def test_depth_is_bounded(text: str) -> None:
    """One level more than MAX_DEPTH is refused with its line, in every notation."""
    with pytest.raises(TomlError, match="nested too deeply") as caught:
        key_lines("\n" + text)
    assert caught.value.line == 2 + text.startswith("[a.b]\n")


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ('a = "b\nc = "d"\n', 1),
        ("a = 1\nb = [\n  'c',\n  'd,\n]\n", 4),
        ('a = 1\nb = """c\n', 2),
        ('a = ["b, "c"]\n', 1),
        ("a = it's\n", None),
        ("a: 'b\n", None),
        ("a = = 1\nb = 'c\n", None),
    ],
)
def test_a_quote_that_is_not_closed_has_a_line(text: str, line: int | None) -> None:
    """That of the text that it begins; any other mistake, or an earlier one, is left to tomllib."""
    if line is None:
        assert not {("b",), ("a",)} & set(key_lines(text))
        return
    with pytest.raises(TomlError, match="no closing quote") as caught:
        key_lines(text)
    assert caught.value.line == line


def test_the_allowed_depth_is_read() -> None:
    """Exactly MAX_DEPTH keys are allowed."""
    path = ("a",) * MAX_DEPTH
    assert key_lines(".".join(path) + " = 1")[path] == 1
