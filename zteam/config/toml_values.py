"""What users write in TOML: single values, their text on one line, and the lines of the keys in a file.

tomllib gives values without lines, so the text is cut into headers and pairs before tomllib reads it as a whole, and
the keys of each get the line where it begins. At a text that is no TOML the lines end without an error: tomllib refuses
the text at the same place or earlier, and tells why. The depth of nesting has a bound, because the memory of tomllib
grows with the square of a dotted key's length.
"""

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

KeyPath = tuple[str | int, ...]
"""The keys from the top down; a number is an index in an array."""

MAX_DEPTH = 32
"""Keys and array indices on the path of a value, at most."""

_TOKEN = re.compile(
    r"""
      (?P<string> \"{3} (?:\\.|[^\\])*? \"{3,5} | '{3} .*? '{3,5} | \" (?:\\.|[^\"\\\n])* \" | ' [^'\n]* ' )
    | (?P<comment> \#[^\n]* ) | (?P<open> [\[{] ) | (?P<close> [\]}] ) | (?P<dot> \. ) | (?P<next> [,=] )
    | (?P<end> \n | \Z ) | (?P<unclosed> ["'] )
    """,
    re.DOTALL | re.VERBOSE,
)


_TOO_DEEP = f"nested too deeply: {MAX_DEPTH} levels are allowed"


class TomlError(ValueError):
    """A mistake that tomllib takes, or tells in its own words; `line` counts from 1."""

    def __init__(self, line: int, text: str) -> None:
        super().__init__(text)
        self.line = line


def key_lines(text: str) -> dict[KeyPath, int]:
    """The line, from 1, of every table and key up to the first mistake in TOML; what a value holds has its key's line.

    Raises TomlError.
    """
    import tomllib  # Robots import this module for its types, and few read TOML.

    lines: dict[KeyPath, int] = {}
    # The number of tables so far in each array that is written as [[name]].
    counts: dict[KeyPath, int] = {}
    table: KeyPath = ()
    for line, statement in _statements(text):
        try:
            found = tomllib.loads(statement)
        except ValueError:
            break
        if not statement.lstrip().startswith("["):
            paths = _paths(found, table)
        else:
            paths, table = [], ()
            while found and isinstance(found, dict):
                ((key, found),) = found.items()
                table = (*table, key)
                paths.append(table)
                if isinstance(found, list):
                    counts[table] = counts.get(table, 0) + 1
                if table in counts:
                    # The last table of an array of tables.
                    table = (*table, counts[table] - 1)
                    paths.append(table)
        for path in paths:
            if len(path) > MAX_DEPTH:
                raise TomlError(line, _TOO_DEEP)
            lines.setdefault(path, line)
    return lines


def _paths(value: Any, path: KeyPath) -> list[KeyPath]:
    """Those of all that a value holds; the value is at `path`. Below a path that is too deep there are none."""
    if len(path) > MAX_DEPTH:
        return []
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    return [found for key, inner in items for found in ((*path, key), *_paths(inner, (*path, key)))]


def _statements(text: str) -> Iterator[tuple[int, str]]:
    """The headers and the pairs of a file, each with its first line. Raises TomlError."""
    line, start, depth, dots = 1, 0, 0, 0
    last, end = None, 0
    for token in _TOKEN.finditer(text):
        kind = token.lastgroup
        depth += (kind == "open") - (kind == "close")
        if kind != "string":
            dots = dots + 1 if kind == "dot" else 0
        if max(depth, dots + 1) > MAX_DEPTH:
            raise TomlError(line + text.count("\n", start, token.start()), _TOO_DEEP)
        if kind == "unclosed":
            if last != "string" and text[end : token.start()].strip():
                # A word without quotes comes before it.
                return
            here = line + text.count("\n", start, token.start())
            raise TomlError(here, "not TOML: the text that begins here has no closing quote")
        last, end = kind, token.end()
        if kind == "end" and depth <= 0:
            yield line, text[start : token.start()].rstrip("\r")
            line += text.count("\n", start, token.end())
            start, depth = token.end(), 0


def line_of(lines: Mapping[KeyPath, int], path: KeyPath) -> int | None:
    """The line of `path`, or of its nearest parent that the text has; None if the text has none."""
    while path and path not in lines:
        path = path[:-1]
    return lines.get(path)


def parse_value(text: str) -> Any:
    """The value as in a team file: TOML (0.4, true, "text", [1, 2]), else the text itself."""
    import tomllib  # Few robots have a parameter.

    line = f"v = {text}"
    try:
        key_lines(line)
        found = tomllib.loads(line)
    except ValueError:
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
