"""A world file's text: how it is found and read, its tokens with those of its includes, and places in it.

An include is text in the place of its line, wherever that line stands: at the top level, in a model, in a macro. File
names are relative to the folder of the top file. Every count is bounded, so that no set of files takes long. What Stage
reads is read here too, with a remark where it is not what the file's author can have meant: a number such as
`3.75.2`, of which C's atof takes the beginning, and text behind an include, which Stage skips."""

import enum
import math
import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from zteam.config.foreign_files import decode_text
from zteam.config.resources import existing_file, read_file
from zteam.errors import WorldError
from zteam.simulator.world.model import Remark

MAX_FILE_BYTES = 16 * 2**20
MAX_TOKENS = 500_000
MAX_FILES = 256
MAX_CHARACTERS = 32 * 2**20
"""Of all included files."""


class TextPlace(NamedTuple):
    """Where something stands in a world file; line and column count from 1."""

    file: str
    line: int
    column: int

    def __str__(self) -> str:
        return f"{self.file}:{self.line}:{self.column}"

    def error(self, text: str) -> WorldError:
        return WorldError(f"{self}: {text}")


class Remarks:
    """What a file says that has no effect here: each place once, even if many models share its macro; at most 200."""

    def __init__(self) -> None:
        self._remarks: dict[tuple[TextPlace, str], None] = {}

    @property
    def is_full(self) -> bool:
        return len(self._remarks) >= 200

    def add(self, place: TextPlace, text: str) -> None:
        """Note `text` unless it has been noted at this place."""
        if not self.is_full:
            self._remarks.setdefault((place, text))

    def all(self) -> tuple[Remark, ...]:
        """In the order of their discovery."""
        return tuple(Remark(*place, text) for place, text in self._remarks)


def find_file(name: str, folder: Path) -> Path | None:
    """A file that a world names: absolute, else in the world's `folder`, else in $STAGEPATH's folders.

    There it is looked for by base name, as Stage does, and by its whole name: an include that Stage finds there may
    name its own bitmaps, which Stage then finds beside it.
    """
    candidates = [folder / name]  # an absolute name wins over the folder
    for other in filter(None, os.environ.get("STAGEPATH", "").split(os.pathsep)):
        candidates += [Path(other) / Path(name).name, Path(other) / name]
    return next(filter(existing_file, candidates), None)


def read_text(path: Path) -> str:
    """The text of a world file; raises WorldError without a place."""
    return decode_text(read_file(path, "world file", MAX_FILE_BYTES, WorldError))


class TokenKind(enum.Enum):
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
    """One token. `written` is its text, without quotes; `value` is the same, but of a number what it is."""

    kind: TokenKind
    written: str
    place: TextPlace
    value: str | float

    def __str__(self) -> str:
        if self.kind in (TokenKind.NAME, TokenKind.STRING):
            return f"{self.written!r:.60}"
        return f"{self.value:g}" if self.kind is TokenKind.NUMBER else self.kind.value


# A run that starts like a number is taken whole: "5m" is one error, and "1.2.3" one remark.
_TOKEN = re.compile(
    r"""
    (?P<skip>[ \t\f\v]+|\#[^\r\n]*)
  | (?P<EOL>\r?\n|\r)
  | (?P<NAME>[A-Za-z][A-Za-z0-9._\-\[\]]*)
  | (?P<NUMBER>[-+.0-9][-+.\w]*)
  | "(?P<STRING>[^"\r\n]*)"
  | (?P<OPEN>\() | (?P<CLOSE>\)) | (?P<OPEN_TUPLE>\[) | (?P<CLOSE_TUPLE>\])
    """,
    re.VERBOSE | re.ASCII,
)
_REST_OF_LINE = re.compile(r"[^\r\n]*")
_ATOF = re.compile(r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)")
_STAGES_NUMBER = re.compile(r"[-+.0-9]+")


def read_tokens(text: str, file: str, remarks: Remarks) -> Iterator[Token]:
    """The tokens of `text` without blanks and comments, EOF last; raises WorldError at text that is no token."""
    line, line_start, position = 1, 0, 0
    including = False
    while position < len(text):
        match = _TOKEN.match(text, position)
        place = TextPlace(file, line, position - line_start + 1)
        if match is None or match.lastgroup is None:
            if text[position] == '"':
                raise place.error("this string is not closed on its line")
            hint = {"{": "; write '('", "}": "; write ')'", "'": '; a string is quoted by "'}.get(text[position], "")
            raise place.error(f"unexpected character {text[position]!r}{hint}")
        position = match.end()
        if match.lastgroup == "skip":
            continue
        kind, written = TokenKind[match.lastgroup], match[match.lastgroup]
        yield Token(kind, written, place, _number(written, place, remarks) if kind is TokenKind.NUMBER else written)
        if kind is TokenKind.EOL:
            line, line_start = line + 1, position
        elif kind is TokenKind.STRING and including:
            rest = next(_REST_OF_LINE.finditer(text, position))[0]
            if rest.strip() and not rest.strip().startswith("#"):
                place = TextPlace(file, line, position - line_start + 1)
                remarks.add(place, f"{rest.strip()!r:.60} behind an include is ignored, as Stage does")
            position += len(rest)
        including = kind is TokenKind.NAME and written == "include"
    yield Token(TokenKind.EOF, "", TextPlace(file, line, position - line_start + 1), "")


def _number(text: str, place: TextPlace, remarks: Remarks) -> float:
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


def splice(text: str, file: str, path: Path | None, folder: Path, remarks: Remarks) -> list[Token]:
    """The tokens of a world file (`path`, if it has one) with those of its includes, whose names are relative to
    `folder`. Raises WorldError."""
    found: list[Token] = []
    sizes: list[int] = []
    """Characters of all included files."""

    def add(token: Token) -> None:
        if len(found) >= MAX_TOKENS:
            raise token.place.error(f"more than {MAX_TOKENS} words and values: this world is refused")
        found.append(token)

    def read(text: str, file: str, open_files: tuple[Path, ...]) -> None:
        tokens = read_tokens(text, file, remarks)
        for token in tokens:
            if token.kind is TokenKind.NAME and token.written == "include":
                include(token.place, next(tokens), open_files)
            elif token.kind is not TokenKind.EOF or len(open_files) == 1:
                add(token)

    def include(place: TextPlace, name: Token, open_files: tuple[Path, ...]) -> None:
        if name.kind is not TokenKind.STRING:
            raise name.place.error(f'expected the name of the file to include, such as "map.inc", found {name}')
        path = find_file(name.written, folder)
        if path is None:
            raise name.place.error(f"included file {name} not found in {folder} or $STAGEPATH")
        if path.resolve() in open_files:
            raise name.place.error(f"{name.written!r} includes itself")
        if len(sizes) + 1 >= MAX_FILES:
            raise name.place.error(f"more than {MAX_FILES} files included")
        try:
            text = read_text(path)
        except WorldError as error:
            raise place.error(str(error)) from None
        sizes.append(len(text))
        if sum(sizes) > MAX_CHARACTERS:
            raise place.error(f"more than {MAX_CHARACTERS} characters in included files: this world is refused")
        read(text, str(path), (*open_files, path.resolve()))
        # The last line of the file may lack its end, and an include ends its own line.
        add(Token(TokenKind.EOL, "", name.place, ""))

    read(text, file, (path.resolve() if path else Path(file),))
    return found
