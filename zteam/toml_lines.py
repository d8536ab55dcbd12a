"""The lines of the keys in a TOML text: tomllib gives values without lines.

One pass over the text, before tomllib reads it. At a text that it does not understand the pass ends without an error:
tomllib refuses the same text at the same place or earlier, and tells why. The pass bounds the depth of nesting, because
the memory of tomllib grows with the square of a dotted key's length.
"""

import re
from bisect import bisect_right
from collections.abc import Mapping

Path = tuple[str | int, ...]
"""The keys from the top down; a number is an index in an array."""

MAX_DEPTH = 32
"""Keys and array indices on the path of a value, at most."""

_BLANK = re.compile(r"(?:[ \t\r\n]|#[^\n]*)*")
_SPACE = re.compile(r"[ \t]*")
_BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")
_STRING = re.compile(
    r"""
      \"{3} (?:\\.|[^\\])*? \"{3,5}
    | '{3} .*? '{3,5}
    | \" (?:\\.|[^\"\\\n])* \"
    | ' [^'\n]* '
    """,
    re.DOTALL | re.VERBOSE,
)
_SCALAR = re.compile(r"[^,\]}#\r\n]+")


class TooDeepError(ValueError):
    """More than MAX_DEPTH keys on the path of a value; `line` counts from 1."""

    def __init__(self, line: int) -> None:
        super().__init__(f"nested too deeply: {MAX_DEPTH} levels are allowed")
        self.line = line


def key_lines(text: str) -> dict[Path, int]:
    """The line, from 1, of every table, key and array element up to the first mistake in TOML. Raises TooDeepError."""
    scan = _Scan(text)
    try:
        scan.document()
    except _NotTomlError:
        pass
    return scan.lines


def line_of(lines: Mapping[Path, int], path: Path) -> int | None:
    """The line of `path`, or of its nearest parent that the text has; None if the text has none."""
    while path and path not in lines:
        path = path[:-1]
    return lines.get(path)


class _NotTomlError(Exception):
    """The text is no TOML that the scan understands."""


class _Scan:
    def __init__(self, text: str) -> None:
        self.lines: dict[Path, int] = {}
        self._text = text
        self._at = 0
        self._newlines = [match.start() for match in re.finditer("\n", text)]
        self._counts: dict[Path, int] = {}
        """The number of tables so far in each array that is written as [[name]]."""

    def document(self) -> None:
        """Read all tables."""
        table: Path = ()
        while self._skip(_BLANK) < len(self._text):
            if self._text.startswith("[", self._at):
                table = self._header()
            else:
                self._pair(table)

    def _header(self) -> Path:
        start, is_array = self._at, self._text.startswith("[[", self._at)
        brackets = 2 if is_array else 1
        self._at += brackets
        *above, last = self._key()
        self._expect("]" * brackets)
        path: Path = ()
        for part in above:
            path = self._newest((*path, part))
            self._note(path, start)
        path = (*path, last)
        if is_array:
            self._counts[path] = self._counts.get(path, 0) + 1
            self._note(path, start)
        path = self._newest(path)
        self._note(path, start)
        return path

    def _newest(self, path: Path) -> Path:
        """The path of the last table of an array of tables; any other path unchanged."""
        return (*path, self._counts[path] - 1) if path in self._counts else path

    def _pair(self, table: Path) -> None:
        start = self._at
        path = table
        for part in self._key():
            path = (*path, part)
            self._note(path, start)
        self._expect("=")
        self._value(path)

    def _key(self) -> list[str]:
        parts = []
        while True:
            self._skip(_SPACE)
            start = self._at
            bare = self._take(_BARE_KEY)
            parts.append(bare if bare is not None else _unquoted(self._take(_STRING)))
            if len(parts) > MAX_DEPTH:
                raise TooDeepError(self._line(start))
            self._skip(_SPACE)
            if not self._text.startswith(".", self._at):
                return parts
            self._at += 1

    def _value(self, path: Path) -> None:
        self._skip(_SPACE)
        if self._text.startswith("[", self._at):
            self._array(path)
        elif self._text.startswith("{", self._at):
            self._inline_table(path)
        elif self._take(_STRING) is None and self._take(_SCALAR) is None:
            raise _NotTomlError

    def _array(self, path: Path) -> None:
        self._at += 1
        index = 0
        while self._skip(_BLANK) < len(self._text) and self._text[self._at] != "]":
            self._note((*path, index), self._at)
            self._value((*path, index))
            index += 1
            self._skip(_BLANK)
            if not self._text.startswith(",", self._at):
                break
            self._at += 1
        self._expect("]")

    def _inline_table(self, path: Path) -> None:
        self._at += 1
        while self._skip(_BLANK) < len(self._text) and self._text[self._at] != "}":
            self._pair(path)
            self._skip(_BLANK)
            if not self._text.startswith(",", self._at):
                break
            self._at += 1
        self._expect("}")

    def _note(self, path: Path, start: int) -> None:
        if len(path) > MAX_DEPTH:
            raise TooDeepError(self._line(start))
        self.lines.setdefault(path, self._line(start))

    def _line(self, at: int) -> int:
        return bisect_right(self._newlines, at - 1) + 1

    def _skip(self, what: re.Pattern[str]) -> int:
        match = what.match(self._text, self._at)
        assert match is not None
        self._at = match.end()
        return self._at

    def _take(self, what: re.Pattern[str]) -> str | None:
        match = what.match(self._text, self._at)
        if match is None:
            return None
        self._at = match.end()
        return match[0]

    def _expect(self, text: str) -> None:
        self._skip(_SPACE)
        if not self._text.startswith(text, self._at):
            raise _NotTomlError
        self._at += len(text)


def _unquoted(text: str | None) -> str:
    if text is None:
        raise _NotTomlError
    if not text.startswith('"'):
        return text[1:-1]
    # Imported here, because robots import this module for its types and read no TOML.
    import tomllib

    try:
        return str(tomllib.loads(f"v = {text}")["v"])
    except tomllib.TOMLDecodeError:
        raise _NotTomlError from None
