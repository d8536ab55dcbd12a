"""zteam.simulator.world.text."""

import pytest

from zteam.simulator.world.text import Remarks, TokenKind, read_tokens


def kinds(text: str) -> list[TokenKind]:
    return [token.kind for token in read_tokens(text, "w.world", Remarks())]


def values(text: str) -> list[object]:
    valued = (TokenKind.NAME, TokenKind.NUMBER, TokenKind.STRING)
    return [token.value for token in read_tokens(text, "w.world", Remarks()) if token.kind in valued]


def test_every_kind_of_token_is_told_apart() -> None:
    """The marks of the language become their kinds, and the stream ends with EOF."""
    assert kinds('model ( size [ 1 "a" ] )\n') == [
        *(
            TokenKind.NAME,
            TokenKind.OPEN,
            TokenKind.NAME,
            TokenKind.OPEN_TUPLE,
            TokenKind.NUMBER,
            TokenKind.STRING,
            TokenKind.CLOSE_TUPLE,
        ),
        *(TokenKind.CLOSE, TokenKind.EOL, TokenKind.EOF),
    ]


def test_an_index_is_part_of_a_name() -> None:
    """`point[0]` is one name, as are dots, dashes and underscores in it."""
    assert values("point[0] block[1].point[2] a-b_c.d") == ["point[0]", "block[1].point[2]", "a-b_c.d"]


@pytest.mark.parametrize(
    ("text", "value"),
    [("5", 5), ("-5.", -5), ("+.5", 0.5), ("1e-3", 0.001), ("-2.5E+2", -250), ("000.100", 0.1)],
)
def test_numbers_may_have_signs_points_and_exponents(text: str, value: float) -> None:
    """All usual ways to write a number are read, exponents too (Stage refuses those)."""
    assert values(text) == [value]


@pytest.mark.parametrize(
    ("text", "value"),
    [
        *(("3.75.2", 3.75), ("1..2", 1), ("1-1", 1), ("-9-13.2", -9), ("2+", 2), ("5.-", 5), ("-.5.", -0.5)),
        *((".", 0), ("-", 0), ("+-1", 0), ("--1", 0), ("..5", 0), ("-.", 0)),
    ],
)
def test_of_a_malformed_number_the_beginning_is_taken(text: str, value: float) -> None:
    """What C's atof, and so Stage, makes of signs, points and digits in any order; a remark says where and what."""
    remarks = Remarks()
    (token, _) = read_tokens(text, "w.world", remarks)
    assert (token.value, token.written) == (value, text)
    expected = f"w.world:1:1: {text!r} is not a number: {value:g} is taken, as Stage does"
    assert [str(remark) for remark in remarks.all()] == [expected]


def test_comments_run_to_the_end_of_the_line_but_not_in_strings() -> None:
    """A `#` ends a line's tokens, however long the comment; between quotes it is a character."""
    assert values('a # b c\n"# d" e' + "#" * 100_000 + "\na") == ["a", "# d", "e", "a"]


def test_places_count_lines_and_columns_from_one() -> None:
    """Every token knows its place, also behind blanks, comments and Windows line ends."""
    tokens = list(read_tokens("a\r\n\t b # c\n  (", "w.world", Remarks()))
    assert [(token.place.line, token.place.column) for token in tokens if token.kind is not TokenKind.EOL] == [
        (1, 1),
        (2, 3),
        (3, 3),
        (3, 4),
    ]


def test_a_carriage_return_alone_ends_a_line() -> None:
    """Files of old Macintoshes have lines and comments like any other, in Stage and here."""
    tokens = list(read_tokens("a # b\rc\r\rd", "w.world", Remarks()))
    words = [token for token in tokens if token.written.strip()]
    assert [(token.written, token.place.line) for token in words] == [("a", 1), ("c", 2), ("d", 4)]
