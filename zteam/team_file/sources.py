"""The files that a team is made of, as they stand on disk: tables of TOML, and the line of each key."""

import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from zteam.errors import ConfigError
from zteam.problems import Problem
from zteam.toml_lines import Path as KeyPath
from zteam.toml_lines import TooDeepError, key_lines, line_of

MAX_BYTES = 2 * 2**20
"""The largest team, 10,000 robots, takes 1 MB."""

Tables = dict[str, Any]


class Source(NamedTuple):
    """One file."""

    path: Path
    tables: Tables
    lines: Mapping[KeyPath, int]
    number: int = 0
    """In the order of reading."""


class Place(NamedTuple):
    """A key in a file."""

    source: Source
    path: KeyPath

    @property
    def line(self) -> int | None:
        """Of the key, or of the table in which it is missing."""
        return line_of(self.source.lines, self.path)

    def __str__(self) -> str:
        return f"{self.source.path}:{self.line}" if self.line else str(self.source.path)

    def describe(self, text: str) -> str:
        """`file:line: key: text`, on one line also where a text of the file has line breaks."""
        return f"{self}: {' '.join(str(Problem(self.path, text)).split())}"


Origins = dict[KeyPath, Place]
"""Where the tables and keys of a merged team stand; what is not listed is in the same place as what holds it."""


def place_of(origins: Mapping[KeyPath, Place], path: KeyPath) -> Place:
    """The place of a key of the merged team."""
    known = path
    while known not in origins:
        known = known[:-1]
    place = origins[known]
    return Place(place.source, (*place.path, *path[len(known) :]))


def read_source(path: Path, number: int = 0) -> Source:
    """The file at `path`. Raises ConfigError if it is not TOML."""
    text = _read(path)
    try:
        lines = key_lines(text)
        tables = tomllib.loads(text)
    except TooDeepError as error:
        raise ConfigError(f"{path}:{error.line}: {error}") from None
    except tomllib.TOMLDecodeError as error:
        found = re.search(r" \(at line (\d+), column (\d+)\)$", str(error))
        place = f"{path}:{found[1]}:{found[2]}" if found else f"{path}"
        told = str(error)[: found.start()] if found else str(error)
        hint = "; text needs quotes" if told == "Invalid value" else ""
        raise ConfigError(f"{place}: not TOML: {told}{hint}") from None
    except ValueError as error:
        # A number of thousands of digits.
        raise ConfigError(f"{path}: not a team file: {' '.join(str(error).split())}") from None
    return Source(path, tables, lines, number)


def _read(path: Path) -> str:
    try:
        with path.open("rb") as file:
            data = file.read(MAX_BYTES + 1)
        if len(data) > MAX_BYTES:
            raise ConfigError(f"{path}: a team file of more than {MAX_BYTES // 2**20} MB is refused")
        return data.decode("utf-8-sig")
    except OSError as error:
        raise ConfigError(f"{path}: cannot read the team file: {error.strerror or error}") from None
    except UnicodeDecodeError as error:
        raise ConfigError(f"{path}: not UTF-8 text (byte {error.start}); save it as UTF-8") from None
