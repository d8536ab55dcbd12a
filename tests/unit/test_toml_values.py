"""Single values in TOML: read from a command line, and written on one line."""

from typing import Any

import pytest

from zteam.toml_values import parse_value, toml_text


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
