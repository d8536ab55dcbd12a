"""Numbers that users type and read."""

import pytest

from zteam.config.numbers import counted, format_factor, format_rate, parse_number, percentile
from zteam.errors import UsageError


def test_the_bounds_belong_to_the_range() -> None:
    """A number equal to a bound is accepted."""
    assert [parse_number(text, 0.5, 1.0, "shares") for text in ("0.5", "1")] == [0.5, 1.0]
    assert [parse_number(text, -3, 5, "steps") for text in ("-3", "5")] == [-3, 5]


def test_spaces_and_leading_zeros_are_ignored() -> None:
    """Neither changes a number."""
    assert parse_number(" 0.5 ", 0.5, 1.0, "shares") == 0.5
    assert parse_number(" 0005 ", -3, 5, "steps") == 5


@pytest.mark.parametrize("text", ["nan", "inf", "0.4", "1.1", "word", ""])
def test_a_number_out_of_range_is_refused(text: str) -> None:
    """The error repeats the text and asks for a number within the bounds."""
    with pytest.raises(UsageError, match=f"^'{text}': give shares from 0.5 to 1$"):
        parse_number(text, 0.5, 1.0, "shares")


def test_an_error_shows_the_start_of_a_long_text() -> None:
    """A text of thousands of characters does not flood the terminal."""
    with pytest.raises(UsageError, match=f"^'{'9' * 24}…': give steps from -3 to 5$"):
        parse_number("9" * 5000, -3, 5, "steps")


@pytest.mark.parametrize("text", ["1.5", "--1", "²", "1_0", "0x1", "6", "-4"])
def test_a_whole_number_has_digits_only(text: str) -> None:
    """Other notations, and numbers out of range, are refused."""
    with pytest.raises(UsageError, match="give steps from -3 to 5"):
        parse_number(text, -3, 5, "steps")


@pytest.mark.parametrize(("share", "expected"), [(0.0, 1.0), (0.5, 51.0), (0.99, 100.0), (1.0, 100.0)])
def test_a_percentile_is_one_of_the_values(share: float, expected: float) -> None:
    """The order of the values does not matter, and the whole share is the largest value; of no values there is none."""
    assert percentile([float(i) for i in range(100, 0, -1)], share) == expected
    assert (percentile([7.0], share), percentile([], share)) == (7.0, None)


@pytest.mark.parametrize(
    ("count", "noun", "text"),
    [
        (0, "robot", "0 robots"),
        (1, "robot", "1 robot"),
        (1_000_000, "tick", "1000000 ticks"),
        (1.0, "second", "1 second"),
        (0.1 + 0.2, "second", "0.3 seconds"),
    ],
)
def test_one_thing_is_singular(count: float, noun: str, text: str) -> None:
    """Every other number is plural, and a number that was computed has no noise."""
    assert counted(count, noun) == text


def test_a_noun_may_have_a_plural_of_its_own() -> None:
    """It is given with the noun."""
    assert [counted(i, "process", "processes") for i in (1, 2)] == ["1 process", "2 processes"]


@pytest.mark.parametrize(("factor", "text"), [(0.98765, "0.99"), (12.3456, "12.3"), (1234.5, "1234")])
def test_a_factor_has_the_digits_that_are_known(factor: float, text: str) -> None:
    """Two decimals at most."""
    assert format_factor(factor) == text


@pytest.mark.parametrize(
    ("rate", "text"), [(10.0021, "10.0 Hz"), (999.96, "1000.0 Hz"), (1.0, "1.0 Hz"), (0.333, "0.33 Hz"), (0.0, "0 Hz")]
)
def test_rates_have_no_digits_of_jitter(rate: float, text: str) -> None:
    """A tenth of a hertz is enough; a slow rate keeps two digits."""
    assert format_rate(rate) == text
