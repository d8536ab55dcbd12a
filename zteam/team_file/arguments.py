"""Arguments of team files: a text that is exactly one `${name}` or `${name:-default}` stands for a value."""

import re
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

from zteam.errors import UsageError, did_you_mean
from zteam.team_file.sources import Place, Source, Tables
from zteam.toml_values import parse_value, toml_text

_REFERENCE = re.compile(r"\$\{([A-Za-z_][A-Za-z0-9_]*)(?::-((?:(?!\$\{).)*))?\}", re.DOTALL)
_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")


class Argument(NamedTuple):
    """One place at which a file takes an argument."""

    name: str
    default: str | None
    """TOML, or a text without quotes; None for an argument that must be given."""
    place: Place


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
            raise UsageError(
                f"argument {name}: {value!r} is no number, text, true, false, list or table of such"
            ) from None
    return found


class Filling:
    """Puts the values of arguments into the tables of files, and notes what the files take."""

    def __init__(self, given: Mapping[str, str]) -> None:
        self._given = given
        self.taken: list[Argument] = []
        self.missing: list[tuple[Place, str]] = []
        """The places of arguments that are not given, and what is wrong there."""

    def fill(self, source: Source) -> Tables:
        """The file's tables with values in the place of its references."""
        return {key: self._filled(value, Place(source, (key,))) for key, value in source.tables.items()}

    def _filled(self, value: Any, place: Place) -> Any:
        if isinstance(value, dict):
            return {key: self._filled(inner, _below(place, key)) for key, inner in value.items()}
        if isinstance(value, list):
            return [self._filled(inner, _below(place, i)) for i, inner in enumerate(value)]
        found = _REFERENCE.fullmatch(value) if isinstance(value, str) else None
        return value if found is None else self._value(Argument(found[1], found[2], place), value)

    def _value(self, argument: Argument, text: str) -> Any:
        self.taken.append(argument)
        name = argument.name
        given = self._given.get(name, argument.default)
        if given is None:
            self.missing.append((argument.place, f"the argument {name} is missing: give {name}=VALUE"))
            return text
        return parse_value(given)

    def unknown(self) -> list[str]:
        """What is wrong with the names of the given arguments."""
        names = list(dict.fromkeys(argument.name for argument in self.taken))
        takes = f"it takes {', '.join(names)}" if names else "it takes none"
        return [
            f"there is no argument {name}{did_you_mean(name, names)}; {takes}"
            for name in self._given
            if name not in names
        ]


def _below(place: Place, key: str | int) -> Place:
    return Place(place.source, (*place.path, key))


def describe_arguments(arguments: Iterable[Argument]) -> list[tuple[str, str, str]]:
    """What a team file takes, for a table: name, default and place of each; a name comes again for each default."""
    found: dict[tuple[str, str | None], Place] = {}
    for argument in arguments:
        found.setdefault((argument.name, argument.default), argument.place)
    return [(name, "" if default is None else default, str(place)) for (name, default), place in found.items()]
