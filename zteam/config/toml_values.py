"""What users write in TOML: single values, their text on one line, and the lines of the keys in a file.

tomllib gives values without lines, so a pass over the text finds them before tomllib reads it. At a text that it does
not understand the pass ends without an error: tomllib refuses the text at the same place or earlier, and tells why.
The pass bounds the depth of nesting, because the memory of tomllib grows with the square of a dotted key's length.
"""

import json
import re
from bisect import bisect_right
from collections.abc import Mapping, Sequence
from typing import Any

KeyPath = tuple[str | int, ...]
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


def key_lines(text: str) -> dict[KeyPath, int]:
    """The line, from 1, of every table, key and array element up to the first mistake in TOML. Raises TooDeepError."""
    scan = _Scan(text)
    try:
        scan.document()
    except _NotTomlError:
        pass
    return scan.lines


def line_of(lines: Mapping[KeyPath, int], path: KeyPath) -> int | None:
    """The line of `path`, or of its nearest parent that the text has; None if the text has none."""
    while path and path not in lines:
        path = path[:-1]
    return lines.get(path)


class _NotTomlError(Exception):
    """The text is no TOML that the scan understands."""


class _Scan:
    def __init__(self, text: str) -> None:
        self.lines: dict[KeyPath, int] = {}
        self._text = text
        self._at = 0
        self._newlines = [match.start() for match in re.finditer("\n", text)]
        self._counts: dict[KeyPath, int] = {}
        """The number of tables so far in each array that is written as [[name]]."""

    def document(self) -> None:
        table: KeyPath = ()
        while self._skip(_BLANK) < len(self._text):
            if self._text.startswith("[", self._at):
                table = self._header()
            else:
                self._pair(table)

    def _header(self) -> KeyPath:
        start, brackets = self._at, 2 if self._text.startswith("[[", self._at) else 1
        self._at += brackets
        keys = self._key()
        self._expect("]" * brackets)
        path: KeyPath = ()
        for count, part in enumerate(keys, 1):
            path = (*path, part)
            if brackets == 2 and count == len(keys):
                self._counts[path] = self._counts.get(path, 0) + 1
                self._note(path, start)
            if path in self._counts:
                # The last table of an array of tables.
                path = (*path, self._counts[path] - 1)
            self._note(path, start)
        return path

    def _pair(self, table: KeyPath) -> None:
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

    def _value(self, path: KeyPath) -> None:
        self._skip(_SPACE)
        closing = {"[": "]", "{": "}"}.get(self._text[self._at : self._at + 1])
        if closing is not None:
            self._inside(path, closing)
        elif self._take(_STRING) is None and self._take(_SCALAR) is None:
            raise _NotTomlError

    def _inside(self, path: KeyPath, closing: str) -> None:
        """An array, or an inline table."""
        self._at += 1
        index = 0
        while self._skip(_BLANK) < len(self._text) and self._text[self._at] != closing:
            if closing == "}":
                self._pair(path)
            else:
                self._note((*path, index), self._at)
                self._value((*path, index))
            index += 1
            self._skip(_BLANK)
            if not self._text.startswith(",", self._at):
                break
            self._at += 1
        self._expect(closing)

    def _note(self, path: KeyPath, start: int) -> None:
        if len(path) > MAX_DEPTH:
            raise TooDeepError(self._line(start))
        self.lines.setdefault(path, self._line(start))

    def _line(self, at: int) -> int:
        return bisect_right(self._newlines, at - 1) + 1

    def _skip(self, what: re.Pattern[str]) -> int:
        self._take(what)
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
    # Imported here, because robots import this module for its types and read no TOML.
    import tomllib

    if text is None:
        raise _NotTomlError
    try:
        return str(tomllib.loads(f"v = {text}")["v"])
    except tomllib.TOMLDecodeError:
        raise _NotTomlError from None


def parse_value(text: str) -> Any:
    """The value as in a team file: TOML (0.4, true, "text", [1, 2]), else the text itself."""
    import tomllib  # Few robots have a parameter.

    line = f"v = {text}"
    try:
        key_lines(line)
        found = tomllib.loads(line)
    except (TooDeepError, ValueError):
        # Also a number of thousands of digits.
        return text
    # Further lines would be further keys.
    return found["v"] if len(found) == 1 else text


def _escaped(character: str) -> str:
    if character.isprintable():
        return character
    return f"\\u{ord(character):04x}" if ord(character) < 0x10000 else f"\\U{ord(character):08x}"


def toml_text(value: Any) -> str:
    """The value as TOML on one line. Raises TypeError for a value that no parameter can have, such as a date."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float) or (isinstance(value, int) and abs(value) < 2**63):
        return repr(value)
    if isinstance(value, str):
        # A JSON string is a TOML string, except for the escapes of what is not printed as it is.
        text = json.dumps(value, ensure_ascii=False)
        return text if text.isprintable() else "".join(map(_escaped, text))
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{toml_text(key)} = {toml_text(item)}" for key, item in value.items()) + "}"
    if isinstance(value, Sequence):
        return "[" + ", ".join(map(toml_text, value)) + "]"
    raise TypeError(value)
