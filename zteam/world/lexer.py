"""Splits a world file's text into tokens, in linear time.

What Stage reads is read here too, with a remark where it is not what the file's author can have meant: a number such
as `3.75.2`, of which C's atof takes the beginning, and text behind an include, which Stage skips.
"""

import enum
import math
import re
from collections.abc import Iterator
from typing import NamedTuple

from zteam.world.sources import Place, Remarks


class Kind(enum.Enum):
    """Kinds of tokens; the value is the kind's name in error texts."""

    NAME = "a name"
    NUMBER = "a number"
    STRING = "a string"
    OPEN = "'('"
    CLOSE = "')'"
    OPEN_TUPLE = "'['"
    CLOSE_TUPLE = "']'"
    EOL = "the end of the line"
    EOF = "the end of the file"


class Token(NamedTuple):
    """One token. `value` is a name or string's text, a number, or None; `text` is a number as written."""

    kind: Kind
    value: str | float | None
    place: Place
    text: str = ""

    def __str__(self) -> str:
        if self.kind in (Kind.NAME, Kind.STRING):
            return f"{self.value!r:.60}"
        return f"{self.value:g}" if self.kind is Kind.NUMBER else self.kind.value


# A run that starts like a number is taken whole: "5m" is one error, and "1.2.3" one remark.
_TOKEN = re.compile(
    r"""
    (?P<skip>[ \t\f\v]+|\#[^\r\n]*)
  | (?P<eol>\r?\n|\r)
  | (?P<name>[A-Za-z][A-Za-z0-9._\-\[\]]*)
  | (?P<number>[-+.0-9][-+.\w]*)
  | "(?P<string>[^"\r\n]*)"
  | (?P<mark>[()\[\]])
    """,
    re.VERBOSE | re.ASCII,
)
_MARKS = {"(": Kind.OPEN, ")": Kind.CLOSE, "[": Kind.OPEN_TUPLE, "]": Kind.CLOSE_TUPLE}
_REST_OF_LINE = re.compile(r"[^\r\n]*")
_ATOF = re.compile(r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)")
_STAGES_NUMBER = re.compile(r"[-+.0-9]+")


def read_tokens(text: str, file: str, remarks: Remarks) -> Iterator[Token]:
    """The tokens of `text` without blanks and comments, EOF last; raises WorldError at text that is no token."""
    line, line_start, position = 1, 0, 0
    including = False
    while position < len(text):
        match = _TOKEN.match(text, position)
        place = Place(file, line, position - line_start + 1)
        if match is None:
            raise _no_token(text, position, place)
        position = match.end()
        kind = match.lastgroup
        if kind == "skip":
            continue
        if kind == "eol":
            yield Token(Kind.EOL, None, place)
            line, line_start = line + 1, position
        elif kind == "name":
            yield Token(Kind.NAME, match["name"], place)
        elif kind == "number":
            yield Token(Kind.NUMBER, _number(match["number"], place, remarks), place, match["number"])
        elif kind == "string":
            yield Token(Kind.STRING, match["string"], place)
            if including:
                position = _skip_line(text, position, Place(file, line, position - line_start + 1), remarks)
        else:
            yield Token(_MARKS[match["mark"]], None, place)
        including = match["name"] == "include"
    yield Token(Kind.EOF, None, Place(file, line, position - line_start + 1))


def _number(text: str, place: Place, remarks: Remarks) -> float:
    try:
        if "_" in text:  # Python's own digit separator
            raise ValueError
        value = float(text)
    except ValueError:
        # Only what Stage takes for one word is cut short: behind "5" in "5m" it sees a name.
        if not _STAGES_NUMBER.fullmatch(text):
            raise place.error(f"{text!r:.60} is not a number") from None
        begin = _ATOF.match(text)
        value = float(begin[0]) if begin else 0.0
        remarks.add(place, f"{text!r:.60} is not a number: {value:g} is taken, as Stage does")
    if not math.isfinite(value):
        raise place.error(f"{text!r:.60} is not a finite number")
    return value


def _skip_line(text: str, position: int, place: Place, remarks: Remarks) -> int:
    """The end of the line; a remark notes anything on the line but a comment."""
    match = _REST_OF_LINE.match(text, position)
    assert match is not None
    rest = match[0].strip()
    if rest and not rest.startswith("#"):
        remarks.add(place, f"{rest!r:.60} behind an include is ignored, as Stage does")
    return match.end()


def _no_token(text: str, position: int, place: Place) -> Exception:
    if text[position] == '"':
        return place.error("this string is not closed on its line")
    hint = {"{": "; write '('", "}": "; write ')'", "'": '; a string is quoted by "'}.get(text[position], "")
    return place.error(f"unexpected character {text[position]!r}{hint}")
