"""Reads team files from disk: TOML with bounds, and every mistake with its line."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, TypeVar

import msgspec

from zteam import resources
from zteam.errors import ConfigError, did_you_mean
from zteam.problems import Problem, problems_of
from zteam.simulation_options import Options
from zteam.team_file.arguments import Argument
from zteam.team_file.entries import NO_WORLD, NodeEntry, RobotEntry, StaticTransform, Team, TeamSection
from zteam.team_file.groups import expand
from zteam.team_file.includes import Gathered, as_file, gather
from zteam.team_file.rules import check_follows, check_nodes, check_robots, check_transforms
from zteam.team_file.sources import Origins, Place, Tables, place_of
from zteam.toml_lines import Path as KeyPath
from zteam.toml_values import toml_text

S = TypeVar("S", bound=msgspec.Struct)

KEYS = ("robots", "team", "nodes", "defaults", "static_transforms", "simulation", "include")
"""Of a team file."""


class TeamFile(msgspec.Struct):
    """The correct part of a team file and of what it includes, and all mistakes."""

    path: Path
    team: Team
    robots: dict[int, RobotEntry]
    """The team's robots by their index in the expanded team, without those that have mistakes."""
    nodes: dict[int, NodeEntry]
    """Its nodes in the same way."""
    origins: Origins
    problems: list[Problem]
    arguments: list[Argument]
    """What it takes."""
    unfilled: frozenset[tuple[int, KeyPath]]
    """Number of the file and path of each key whose argument is missing."""

    def place(self, path: KeyPath) -> Place:
        """Where a key of the team stands."""
        return place_of(self.origins, path)

    def is_unfilled(self, path: KeyPath) -> bool:
        """Whether the value of this key is not known, because its argument is missing."""
        place = self.place(path)
        return (place.source.number, place.path) in self.unfilled

    def describe(self, problem: Problem) -> str:
        """`file:line: key: what is wrong`."""
        return self.place(problem.path).describe(problem.text)

    def error(self, problems: Iterable[Problem]) -> ConfigError:
        """An error with one line per problem, in the order of the files; what is told of a place twice is one line."""

        def order(problem: Problem) -> tuple[int, int]:
            place = self.place(problem.path)
            return place.source.number, place.line or 0

        return ConfigError("\n".join(dict.fromkeys(map(self.describe, sorted(problems, key=order)))))


def load_team(path: Path, arguments: Mapping[str, str] | None = None) -> Team:
    """The team file at `path`. Raises ConfigError with one line for each mistake in it.

    `arguments` are TOML, or texts without quotes, by name.
    """
    file = read_team_file(path, arguments)
    if file.problems:
        raise file.error(file.problems)
    return file.team


def read_team_file(path: Path, arguments: Mapping[str, str] | None = None) -> TeamFile:
    """The team file at `path` with the mistakes in its keys. Raises ConfigError if a file is not TOML."""
    given = arguments or {}
    return _from_files(path, gather(path, given), tuple(f"{name}={text}" for name, text in given.items()))


def read_team_tables(name: str, tables: Tables) -> TeamFile:
    """A team that a program gives as tables, with the mistakes in them; errors call it `name`."""
    return _from_files(Path(name), as_file(name, tables), ())


def team_world(file: TeamFile) -> Path | None:
    """The world file that a team file asks for, None for real robots. Raises ConfigError."""
    world = file.team.team.world
    if world is None:
        raise file.error(
            [Problem(("team",), 'the key world is missing: say --world FILE, or world = "office" in [team]')]
        )
    if world == NO_WORLD:
        return None
    found = resources.existing_file(file.path.parent / world) or resources.shipped_world(world)
    if found is None:
        known = resources.names(resources.worlds_folder(), ".world")
        shipped = f"a shipped world ({', '.join(known)}){did_you_mean(world, known)}"
        text = f"{world!r} is neither a file beside the team file nor {shipped}"
        raise file.error([Problem(("team", "world"), text)])
    return found


def _from_files(path: Path, files: Gathered, arguments: tuple[str, ...]) -> TeamFile:
    tables, origins = files.layer
    origins |= {(source.number,): Place(source, ()) for source in files.sources}
    problems: list[Problem] = []
    for key in [key for key in tables if key not in KEYS]:
        problems.append(Problem((key,), f"unknown key{did_you_mean(key, KEYS)}; known: {', '.join(KEYS)}"))
        tables, origins = _as_meant(tables, origins, key)
    if "robots" not in tables:
        problems.append(Problem((), "the key robots is missing: add a table [[robots]] with an id"))
    elif tables["robots"] == []:
        problems.append(Problem(("robots",), "no robot is listed: add a table [[robots]] with an id"))
    expanded = expand(tables, origins)
    folders = dict.fromkeys(str(source.path.parent.resolve()) for source in files.sources)
    known = Team([], arguments=arguments, folders=tuple(folders))
    missing = frozenset((place.source.number, place.path) for place, _ in files.missing)
    file = TeamFile(path, known, {}, {}, expanded.origins, [], files.arguments, missing)
    problems += [*expanded.problems, *_read_entries(file, expanded.tables, ids_known=expanded.ids_known)]
    told = [Problem((place.source.number, *place.path), text) for place, text in (*files.missing, *files.problems)]
    file.problems = [*told, *(problem for problem in problems if not file.is_unfilled(problem.path))]
    return file


def _read_entries(file: TeamFile, tables: Tables, *, ids_known: bool) -> list[Problem]:
    """Give `file` the entries of tables without groups; what is wrong with them."""
    problems: list[Problem] = []
    robots = file.robots = _array(tables, "robots", RobotEntry, problems)
    nodes = _array(tables, "nodes", NodeEntry, problems)
    transforms = _array(tables, "static_transforms", StaticTransform, problems)
    for i, entry in nodes.items():
        folder = file.place(("nodes", i)).source.path.parent / entry.folder
        file.nodes[i] = msgspec.structs.replace(entry, folder=str(folder.absolute()))
    ids = {table["id"] for table in _tables_of(tables, "robots") if isinstance(table.get("id"), int)}
    problems += [*check_robots(robots), *check_follows(robots, ids if ids_known else None)]
    problems += [*check_nodes(nodes, ids), *check_transforms(transforms)]
    file.team = msgspec.structs.replace(
        file.team,
        robots=list(robots.values()),
        nodes=list(file.nodes.values()),
        static_transforms=list(transforms.values()),
        team=_section(tables, "team", TeamSection, problems),
        simulation=_section(tables, "simulation", Options, problems),
    )
    return problems


def _as_meant(tables: Tables, origins: Origins, key: str) -> tuple[Tables, Origins]:
    """The tables and origins with `key` under the known name that it is like, unless the file has that one too.

    So [[robot]] instead of [[robots]] is one mistake, and the tables below it are checked all the same.
    """
    meant = next((name for name in KEYS if did_you_mean(key, [name]) and name not in tables), "")
    if not meant:
        return tables, origins
    moved = {(meant, *path[1:]): place for path, place in origins.items() if path[:1] == (key,)}
    return {**tables, meant: tables[key]}, {**origins, **moved}


def _array(tables: Tables, name: str, kind: type[S], problems: list[Problem]) -> dict[int, S]:
    """The correct entries of a [[name]] array, by index."""
    value = tables.get(name, [])
    if not isinstance(value, list):
        text = f"a list of tables is expected, written with two brackets, as in [[{name}]]"
        problems.append(Problem((name,), text))
        return {}
    found = {}
    for i, table in enumerate(value):
        if isinstance(table, dict):
            table = _with_params(table) if kind is RobotEntry else _with_words(table)
        entry = _convert(table, kind, (name, i), problems)
        if entry is not None:
            found[i] = entry
    return found


def _section(tables: Tables, name: str, kind: type[S], problems: list[Problem]) -> S:
    """The correct part of a [name] table."""
    table = tables.get(name, {})
    found = problems_of(table, kind, (name,))
    problems += found
    wrong = {problem.path[1] for problem in found if len(problem.path) > 1}
    if not isinstance(table, dict) or (found and not wrong):
        return kind()
    right = {key: value for key, value in table.items() if key not in wrong}
    return kind() if problems_of(right, kind) else msgspec.convert(right, kind)


def _convert(table: Any, kind: type[S], path: KeyPath, problems: list[Problem]) -> S | None:
    found = problems_of(table, kind, path)
    problems += found
    return None if found else msgspec.convert(table, kind)


def _tables_of(tables: Tables, name: str) -> list[Tables]:
    value = tables.get(name)
    return [table for table in value if isinstance(table, dict)] if isinstance(value, list) else []


def _with_params(robot: Tables) -> Tables:
    """The table with the parameters of the behaviour collected under `params`."""
    ours = set(RobotEntry.__struct_fields__) - {"params"}
    return {key: value for key, value in robot.items() if key in ours} | {
        "params": {key: value for key, value in robot.items() if key not in ours}
    }


def _with_words(node: Tables) -> Tables:
    """The table with the numbers and truth values in its command as texts: an argument may be one."""
    command = node.get("command")
    if not isinstance(command, list):
        return node
    return {**node, "command": [_as_word(part) for part in command]}


def _as_word(part: Any) -> Any:
    is_number = isinstance(part, float) or (isinstance(part, int) and abs(part) < 2**63)
    return toml_text(part) if is_number else part
