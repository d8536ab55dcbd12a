"""Splits a world file's text into tokens, in linear time."""

import enum
import math
import re
from collections.abc import Iterator
from typing import NamedTuple

from zteam.world.sources import Place


class Kind(enum.Enum):
    """What a token is; the value is how an error text calls it."""

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
    """One token. `value` is a name or string's text, a number, or None."""

    kind: Kind
    value: str | float | None
    place: Place

    def __str__(self) -> str:
        if self.kind in (Kind.NAME, Kind.STRING):
            return f"{self.value!r:.60}"
        return f"{self.value:g}" if self.kind is Kind.NUMBER else self.kind.value


# A run that starts like a number is taken whole and judged by float(): "1.2.3" and "5m" are then one error each.
_TOKEN = re.compile(
    r"""
    (?P<skip>[ \t\r\f\v]+|\#[^\n]*)
  | (?P<eol>\n)
  | (?P<name>[A-Za-z][A-Za-z0-9._\-\[\]]*)
  | (?P<number>[-+.0-9][-+.\w]*)
  | "(?P<string>[^"\n]*)"
  | (?P<mark>[()\[\]])
    """,
    re.VERBOSE | re.ASCII,
)
_MARKS = {"(": Kind.OPEN, ")": Kind.CLOSE, "[": Kind.OPEN_TUPLE, "]": Kind.CLOSE_TUPLE}


def read_tokens(text: str, file: str) -> Iterator[Token]:
    """The tokens of `text` without blanks and comments, EOF last; raises WorldError at what is none."""
    line, line_start, position = 1, 0, 0
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
            yield Token(Kind.NUMBER, _number(match["number"], place), place)
        elif kind == "string":
            yield Token(Kind.STRING, match["string"], place)
        else:
            yield Token(_MARKS[match["mark"]], None, place)
    yield Token(Kind.EOF, None, Place(file, line, position - line_start + 1))


def _number(text: str, place: Place) -> float:
    try:
        if "_" in text:  # Python's own digit separator
            raise ValueError
        value = float(text)
    except ValueError:
        raise place.error(f"{text!r:.60} is not a number") from None
    if not math.isfinite(value):
        raise place.error(f"{text!r:.60} is not a finite number")
    return value


def _no_token(text: str, position: int, place: Place) -> Exception:
    if text[position] == '"':
        return place.error("this string is not closed on its line")
    return place.error(f"unexpected character {text[position]!r}")
