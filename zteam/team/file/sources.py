"""From files to one table: a team file, the files that it includes, and the arguments that fill them.

What stands in a file wins over what it includes, and a later include over an earlier one. Lists of tables follow each
other: first those of the included files, in their order. Every table knows where it and its keys stand.
"""

import re
import tomllib
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import msgspec

from zteam.config import resources
from zteam.config.foreign_files import TEAM_FILE, name_foreign
from zteam.config.problems import Problem
from zteam.config.toml_values import KeyPath, TomlError, key_lines, line_of, parse_value, toml_text
from zteam.errors import ConfigError, UsageError, did_you_mean

MAX_BYTES = 2 * 2**20
"""The largest team, 10,000 robots, takes 1 MB."""
MAX_FILES = 100
"""Of one team: a file may be included more than once, so few files can make many."""
LISTS = ("robots", "nodes", "static_transforms")
"""The keys that hold a list of tables."""
_PATHS = re.compile(
    r"team\.(?:world|map)|(?:defaults|robots\.\d+)\.(?:description|navigation\.params)|nodes\.\d+\.(?:folder|command\.0)"
)
_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
# Braces in quotes do not count. A quote may also stand alone.
_QUOTED = r'"(?:(?:(?!\$\{)[^"\\]|\\.)*")?+'
_BRACED = r"\{\}"
for _ in range(10):
    # Tables in tables.
    _BRACED = rf'\{{(?:{_QUOTED}|[^{{}}"]|{_BRACED})*+\}}'
_DEFAULT = rf'(?:\$(?!\{{)|{_QUOTED}|[^${{}}"]|{_BRACED})*+'
_REFERENCE = re.compile(rf"(?P<escape>\$?)\$\{{(?P<name>{_NAME.pattern})(?::-(?P<default>{_DEFAULT}))?\}}")


_HINTS = {
    "Invalid value": "; text needs quotes (numbers such as 0.5, true and false do not)",
    "Expected '=' after a key in a key/value pair": "; write key = value",
}
"""The way out, by what tomllib finds wrong."""


class Source(msgspec.Struct, frozen=True, eq=False):
    path: Path
    lines: Mapping[KeyPath, int] = {}
    number: int = 0
    """In the order of reading."""


class KeyPlace(NamedTuple):
    source: Source
    path: KeyPath = ()

    @property
    def line(self) -> int | None:
        """Of the key, or of the table in which it is missing."""
        return line_of(self.source.lines, self.path)

    def below(self, key: str | int) -> "KeyPlace":
        """A key of the table, or an element of the list, that stands here."""
        return KeyPlace(self.source, (*self.path, key))

    def __str__(self) -> str:
        return f"{self.source.path}:{self.line}" if self.line else str(self.source.path)


class Mistake(NamedTuple):
    place: KeyPlace
    text: str

    def __str__(self) -> str:
        """`file:line: key: text`, on one line also where a text of the file has line breaks."""
        return f"{self.place}: {' '.join(str(Problem(self.place.path, self.text)).splitlines())}"


def error_of(mistakes: Iterable[Mistake]) -> ConfigError:
    """An error with one line per mistake, in the order of the files; what is told of a place twice is one line."""
    ordered = sorted(mistakes, key=lambda found: (found.place.source.number, found.place.line or 0))
    return ConfigError("\n".join(dict.fromkeys(map(str, ordered))))


class Table(dict[str, Any]):
    """A table of a file, or one that was made of several."""

    def __init__(self, place: KeyPlace) -> None:
        super().__init__()
        self.place = place
        self._places: dict[str, KeyPlace] = {}
        """Of keys that do not stand in the table at `place`."""

    def put(self, key: str, value: Any, place: KeyPlace) -> None:
        self[key], self._places[key] = value, place

    def place_of(self, *path: str | int) -> KeyPlace:
        """Where the value at a path below this table stands."""
        place, inner = self.place, self
        for step in path:
            place = inner._places.get(str(step), place.below(step)) if isinstance(inner, Table) else place.below(step)
            try:
                inner = inner[step]  # type: ignore[index]
            except (LookupError, TypeError):
                inner = None  # type: ignore[assignment]
            if isinstance(inner, Table):
                place = inner.place
        return place

    def locate(self, problems: Iterable[Problem]) -> list[Mistake]:
        """Problems of this table where their keys stand."""
        return [Mistake(self.place_of(*problem.path), problem.text) for problem in problems]


def merge(base: Table, over: Table, *, lists: Collection[str] = (), depth: int = 99) -> Table:
    """Both tables key by key, to a depth; of anything else that of `over`, but `lists` follow each other."""
    merged = Table(over.place)
    for table in (base, over):
        for key, value in table.items():
            before = merged.get(key)
            if key in lists and isinstance(value, list) and isinstance(before, list):
                value = [*before, *value]
            elif depth and isinstance(value, Table) and isinstance(before, Table):
                value = merge(before, value, depth=depth - 1)
            merged.put(key, value, value.place if isinstance(value, Table) else table.place_of(key))
    return merged


def _placed(value: Any, place: KeyPlace, fill: Callable[[str, KeyPlace], Any] | None = None) -> Any:
    """A value of a file with Tables for its tables; `fill` gives what its texts stand for."""
    if isinstance(value, dict):
        table = Table(place)
        table.update((key, _placed(inner, place.below(key), fill)) for key, inner in value.items())
        return table
    if isinstance(value, list):
        return [_placed(inner, place.below(i), fill) for i, inner in enumerate(value)]
    if not isinstance(value, str):
        return value
    return fill(value, place) if fill else _as_path(value, place)


def _as_path(text: str, place: KeyPlace) -> str:
    """A text of this place. Of a path, `~/` is the user's folder, and an included file's own folder comes before it."""
    if not _PATHS.fullmatch(".".join(map(str, place.path))):
        return text
    text, key = resources.from_home(text), place.path[-1]
    beside = place.source.path.parent.resolve() / text
    is_file = key in ("map", "description", "params") or (key == "world" and resources.existing_file(beside))
    return str(beside) if is_file and place.source.number else text


class Argument(NamedTuple):
    """One place at which a file takes an argument: `${name}` or `${name:-default}`, in a text or for it."""

    name: str
    default: str | None
    """TOML, or a text without quotes; None for an argument that must be given."""
    place: KeyPlace


def parse_arguments(words: Iterable[str]) -> dict[str, str]:
    """The arguments of a command line, NAME=VALUE each. Raises UsageError."""
    found: dict[str, str] = {}
    for word in words:
        name, equals, text = word.partition("=")
        if not equals or not _NAME.fullmatch(name):
            raise UsageError(f"argument {word!r} is not NAME=VALUE, such as leader=2")
        if name in found:
            raise UsageError(f"argument {name} is given twice: {found[name]} and {text}")
        found[name] = text
    return found


def argument_texts(values: Mapping[str, Any]) -> dict[str, str]:
    """The same arguments, given as values of Python. Raises UsageError for a value that TOML lacks."""
    found = {}
    for name, value in values.items():
        try:
            found[name] = toml_text(value)
        except TypeError:
            told = f"argument {name}: {value!r} is no number, text, true, false, list or table of such"
            raise UsageError(told) from None
    return found


def describe_arguments(arguments: Iterable[Argument]) -> list[tuple[str, str, str]]:
    """What a team file takes, for a table: name, default and place of each; a name comes again for each default."""
    found: dict[tuple[str, str | None], KeyPlace] = {}
    for argument in arguments:
        found.setdefault((argument.name, argument.default), argument.place)
    return [(name, default or "", str(place)) for (name, default), place in found.items()]


class Files:
    """All files of a team, in the order of reading."""

    def __init__(self, given: Mapping[str, str]) -> None:
        """`given` are the arguments."""
        self.sources: list[Source] = []
        self.arguments: list[Argument] = []
        """What the files take."""
        self.missing: list[Mistake] = []
        """Arguments that were not given."""
        self.mistakes: list[Mistake] = []
        self._given = given

    def gather(self, path: Path) -> Table:
        """The merged table of a file and of what it includes.

        Raises ConfigError for the first file that is not TOML, and for too many files.
        """
        table = self._read(path, ())
        table.pop("include", None)
        names = list(dict.fromkeys(argument.name for argument in self.arguments))
        takes = f"it takes {', '.join(names)}" if names else "it takes none"
        for name in [name for name in self._given if name not in names]:
            told = f"there is no argument {name}{did_you_mean(name, names)}; {takes}"
            self.mistakes.append(Mistake(KeyPlace(self.sources[0]), told))
        return table

    def adopt(self, name: str, tables: Mapping[str, Any]) -> Table:
        """Tables that a program gives, as if the file `name` held them."""
        self.sources.append(Source(Path(name)))
        table: Table = _placed(dict(tables), KeyPlace(self.sources[0]))
        return table

    def _read(self, path: Path, above: tuple[Path, ...]) -> Table:
        """A file below the files `above`, with what it includes."""
        lines, tables = read_toml(path)
        source = Source(path, lines, len(self.sources))
        self.sources.append(source)
        own = _placed(tables, KeyPlace(source), self._fill)
        merged = Table(own.place)
        for found in self._included(own, (*above, path)):
            merged = merge(merged, self._read(found, (*above, path)), lists=LISTS)
        return merge(merged, own, lists=LISTS)

    def _fill(self, text: str, place: KeyPlace) -> Any:
        """The value that a whole text stands for; else the text, with the texts of the arguments in it."""

        def take(found: re.Match[str]) -> tuple[Any, str]:
            if found["escape"]:
                return "", found[0][1:]
            name, default = found["name"], found["default"]
            self.arguments.append(Argument(name, default, place))
            given = self._given.get(name, default)
            if given is None:
                told = f"the argument {name} is missing: give {name}=VALUE ($${{{name}}} is this text itself)"
                self.missing.append(Mistake(place, told))
                return "", found[0]
            value = parse_value(given)
            return value, value if isinstance(value, str) else given

        whole = _REFERENCE.fullmatch(text)
        if whole is not None and not whole["escape"]:
            return _placed(take(whole)[0], place)
        return _as_path(_REFERENCE.sub(lambda found: take(found)[1], text), place)

    def _included(self, table: Table, above: tuple[Path, ...]) -> Iterator[Path]:
        listed = table.get("include", [])
        if not (isinstance(listed, list) and all(isinstance(text, str) and text for text in listed)):
            told = 'a list of team files is expected, such as ["base.toml"]'
            self.mistakes.append(Mistake(table.place_of("include"), told))
            listed = []
        for i, text in enumerate(listed):
            place = table.place_of("include", i)
            if len(self.sources) >= MAX_FILES:
                raise error_of([Mistake(place, f"more than {MAX_FILES} files are included")])
            try:
                found = resources.find_team(text, place.source.path.parent)
                if found.resolve() in (path.resolve() for path in above):
                    chain = " → ".join(path.name for path in (*above, found))
                    raise UsageError(f"the files include each other in a circle ({chain})")
                yield found
            except UsageError as error:
                self.mistakes.append(Mistake(place, str(error)))


def read_toml(path: Path, what: str = "team file") -> tuple[Mapping[KeyPath, int], dict[str, Any]]:
    """The lines of the keys in a file, and its tables. Raises ConfigError if it is not TOML."""
    data = resources.read_file(path, what, MAX_BYTES, ConfigError)
    with name_foreign(path, what, TEAM_FILE):
        try:
            text = data.decode("utf-8-sig")
            return key_lines(text), tomllib.loads(text)
        except TomlError as error:
            raise ConfigError(f"{path}:{error.line}: {error}") from None
        except ValueError as error:
            # Not UTF-8, no TOML, or a number of thousands of digits.
            told, _, place = " ".join(str(error).split()).partition(" (at line ")
            line_and_column = re.findall(r"\d+", place)
            hint = _HINTS.get(told, "")
            if path.suffix.lower() != ".toml":
                hint = f"; a {what} is TOML (docs/team-files.md translates launch files of ROS)"
            hint = "; save it as UTF-8" if isinstance(error, UnicodeDecodeError) else hint
            raise ConfigError(f"{':'.join([str(path), *line_and_column])}: not TOML: {told}{hint}") from None
