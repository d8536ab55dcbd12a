"""A team file with the files that it includes, merged into one set of tables that knows where each key stands.

What stands in a file wins over what it includes, and a later include over an earlier one. Lists of tables follow each
other: first those of the included files, in their order.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from zteam import resources
from zteam.errors import ConfigError
from zteam.team_file.arguments import Argument, Filling
from zteam.team_file.sources import Origins, Place, Source, Tables, read_source
from zteam.toml_lines import Path as KeyPath

MAX_FILES = 100
"""Of one team: a file may be included more than once, so few files can make many."""
LISTS = ("robots", "nodes", "static_transforms")
"""The keys that hold a list of tables."""


class Layer(NamedTuple):
    """Merged tables, and where their keys stand."""

    tables: Tables
    origins: Origins


class Gathered(NamedTuple):
    """All files of a team."""

    layer: Layer
    sources: list[Source]
    arguments: list[Argument]
    """What the files take."""
    missing: list[tuple[Place, str]]
    """Arguments that were not given."""
    problems: list[tuple[Place, str]]
    """Further mistakes."""


def gather(path: Path, given: Mapping[str, str]) -> Gathered:
    """The team file at `path` with the files that it includes, filled with these arguments.

    Raises ConfigError for the first file that is not TOML, and for too many files.
    """
    reading = _Reading(Filling(given))
    layer = reading.read(path, ())
    layer.tables.pop("include", None)
    filling, root = reading.filling, Place(reading.sources[0], ())
    problems = [*reading.problems, *((root, text) for text in filling.unknown())]
    return Gathered(layer, reading.sources, filling.taken, filling.missing, problems)


def as_file(name: str, tables: Tables) -> Gathered:
    """Tables that a program gives, as if the file `name` held them."""
    source = Source(Path(name), tables, {})
    return Gathered(Layer(tables, _origins_of(source, tables, ())), [source], [], [], [])


class _Reading:
    def __init__(self, filling: Filling) -> None:
        self.filling = filling
        self.sources: list[Source] = []
        self.problems: list[tuple[Place, str]] = []

    def read(self, path: Path, above: tuple[Path, ...]) -> Layer:
        """A file below the files `above`, with what it includes."""
        source = read_source(path, len(self.sources))
        self.sources.append(source)
        tables = self.filling.fill(source)
        own = Layer(tables, _origins_of(source, tables, ()))
        if above:
            _fix_paths(tables, path.parent.resolve())
        merged = Layer({}, {})
        for place, text in self._included(source, tables.get("include", [])):
            found = self._find(place, text, (*above, path))
            if found is not None:
                merged = _merge(merged, self.read(found, (*above, path)))
        return _merge(merged, own)

    def _included(self, source: Source, value: Any) -> list[tuple[Place, str]]:
        place = Place(source, ("include",))
        if not isinstance(value, list):
            self.problems.append((place, 'a list of team files is expected, such as ["base.toml"]'))
            return []
        found = []
        for i, text in enumerate(value):
            if isinstance(text, str) and text:
                found.append((Place(source, ("include", i)), text))
            else:
                self.problems.append((Place(source, ("include", i)), "the name of a team file is expected"))
        return found

    def _find(self, place: Place, text: str, above: tuple[Path, ...]) -> Path | None:
        beside = place.source.path.parent / text
        found = resources.existing_file(beside) or resources.shipped_team(text)
        if found is None and resources.is_folder(beside):
            self.problems.append((place, f"{text!r} is a folder; name the team file in it (*.toml)"))
        elif found is None:
            known = ", ".join(resources.names(resources.teams_folder(), ".toml"))
            told = f"{text!r} is neither a file beside this one nor a shipped team ({known})"
            self.problems.append((place, told))
        elif found.resolve() in (path.resolve() for path in above):
            chain = " → ".join(path.name for path in (*above, found))
            self.problems.append((place, f"the files include each other in a circle ({chain})"))
        elif len(self.sources) >= MAX_FILES:
            raise ConfigError(place.describe(f"more than {MAX_FILES} files are included"))
        else:
            return found
        return None


def _origins_of(source: Source, tables: Mapping[str, Any], path: KeyPath) -> Origins:
    """The places of a file's tables, of their keys, and of each table in a list."""
    found: Origins = {path: Place(source, path)}
    for key, value in tables.items():
        below = (*path, key)
        found[below] = Place(source, below)
        if isinstance(value, dict):
            found |= _origins_of(source, value, below)
        elif path == () and key in LISTS and isinstance(value, list):
            found |= {(key, i): Place(source, (key, i)) for i in range(len(value))}
    return found


def _merge(base: Layer, over: Layer) -> Layer:
    tables, origins = dict(base.tables), {**base.origins}
    shifts: dict[str, int] = {}
    for key, value in over.tables.items():
        before = tables.get(key)
        if key in LISTS and isinstance(value, list) and isinstance(before, list):
            shifts[key] = len(before)
            tables[key] = [*before, *value]
        else:
            tables[key] = _merged(before, value)
    for path, place in over.origins.items():
        if path[:1] and path[0] in shifts and len(path) > 1 and isinstance(path[1], int):
            origins[path[0], path[1] + shifts[str(path[0])]] = place
        else:
            origins[path] = place
    return Layer(tables, origins)


def _merged(base: Any, over: Any) -> Any:
    """Tables key by key; anything else is replaced."""
    if not (isinstance(base, dict) and isinstance(over, dict)):
        return over
    return {**base, **{key: _merged(base.get(key), value) for key, value in over.items()}}


def _fix_paths(tables: Tables, folder: Path) -> None:
    """Let the paths of an included file name the same files from anywhere."""
    team = tables.get("team")
    if isinstance(team, dict) and isinstance(team.get("world"), str):
        beside = resources.existing_file(folder / team["world"])
        if beside is not None:
            team["world"] = str(beside)
    if isinstance(team, dict) and isinstance(team.get("map"), str):
        team["map"] = str(folder / team["map"])
    robots = tables.get("robots")
    for table in [tables.get("defaults"), *(robots if isinstance(robots, list) else [])]:
        for holder, key in ((table, "description"), (_below(table, "navigation"), "params")):
            if isinstance(_below(holder, key), str):
                holder[key] = str(folder / holder[key])


def _below(table: Any, key: str) -> Any:
    return table.get(key) if isinstance(table, dict) else None
