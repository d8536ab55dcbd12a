"""Reads team files from disk: TOML with bounds, and every mistake with its line."""

import re
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, TypeVar

import msgspec

from zteam import resources
from zteam.errors import ConfigError
from zteam.problems import Problem, did_you_mean, problems_of
from zteam.simulation_options import Options
from zteam.team_file.entries import NO_WORLD, RobotEntry, StaticTransform, Team, TeamSection
from zteam.team_file.rules import check_follows, check_robots, check_transforms
from zteam.toml_lines import Path as KeyPath
from zteam.toml_lines import TooDeepError, key_lines, line_of

S = TypeVar("S", bound=msgspec.Struct)

MAX_BYTES = 2 * 2**20
"""The largest team, 10,000 robots, takes 1 MB."""


class TeamFile(msgspec.Struct):
    """The correct part of a team file, and all its mistakes."""

    path: Path
    team: Team
    robots: dict[int, RobotEntry]
    """The team's robots by their index in the file, without the tables that have mistakes."""
    lines: Mapping[KeyPath, int]
    problems: list[Problem]

    def describe(self, problem: Problem) -> str:
        """`file:line: key: what is wrong`."""
        line = line_of(self.lines, problem.path)
        # On one line, also where a text of the file has line breaks.
        told = " ".join(str(problem).split())
        return f"{self.path}:{line}: {told}" if line else f"{self.path}: {told}"

    def error(self, problems: Iterable[Problem]) -> ConfigError:
        """An error with one line per problem, in the order of the file."""
        ordered = sorted(problems, key=lambda problem: line_of(self.lines, problem.path) or 0)
        return ConfigError("\n".join(map(self.describe, ordered)))


def load_team(path: Path) -> Team:
    """The team file at `path`. Raises ConfigError with one line for each mistake in it."""
    file = read_team_file(path)
    if file.problems:
        raise file.error(file.problems)
    return file.team


def read_team_file(path: Path) -> TeamFile:
    """The team file at `path` with the mistakes in its keys. Raises ConfigError if the file is not TOML."""
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
    return _from_tables(path, tables, lines)


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


def _from_tables(path: Path, tables: dict[str, Any], lines: Mapping[KeyPath, int]) -> TeamFile:
    problems: list[Problem] = []
    known = Team.__struct_fields__
    for key in [key for key in tables if key not in known]:
        problems.append(Problem((key,), f"unknown key{did_you_mean(key, known)}; known: {', '.join(known)}"))
        tables, lines = _as_meant(tables, lines, key)
    if "robots" not in tables:
        problems.append(Problem((), "the key robots is missing: add a table [[robots]] with an id"))
    elif tables["robots"] == []:
        problems.append(Problem(("robots",), "no robot is listed: add a table [[robots]] with an id"))
    robots = _array(tables, "robots", RobotEntry, problems)
    transforms = _array(tables, "static_transforms", StaticTransform, problems)
    ids = {table["id"] for table in _tables_of(tables, "robots") if isinstance(table.get("id"), int)}
    problems += [*check_robots(robots), *check_follows(robots, ids), *check_transforms(transforms)]
    section = _section(tables, "team", TeamSection, problems)
    simulation = _section(tables, "simulation", Options, problems)
    team = Team(list(robots.values()), section, list(transforms.values()), simulation)
    return TeamFile(path, team, robots, lines, problems)


def _as_meant(
    tables: dict[str, Any], lines: Mapping[KeyPath, int], key: str
) -> tuple[dict[str, Any], Mapping[KeyPath, int]]:
    """The tables and lines with `key` under the known name that it is like, unless the file has that one too.

    So [[robot]] instead of [[robots]] is one mistake, and the tables below it are checked all the same.
    """
    meant = next((name for name in Team.__struct_fields__ if did_you_mean(key, [name]) and name not in tables), "")
    if not meant:
        return tables, lines
    moved = {(meant, *path[1:]): line for path, line in lines.items() if path[:1] == (key,)}
    return {**tables, meant: tables[key]}, {**lines, **moved}


def _array(tables: dict[str, Any], name: str, kind: type[S], problems: list[Problem]) -> dict[int, S]:
    """The correct entries of a [[name]] array, by index."""
    value = tables.get(name, [])
    if not isinstance(value, list):
        text = f"a list of tables is expected, written with two brackets, as in [[{name}]]"
        problems.append(Problem((name,), text))
        return {}
    found = {}
    for i, table in enumerate(value):
        if kind is RobotEntry and isinstance(table, dict):
            table = _with_params(table)
        entry = _convert(table, kind, (name, i), problems)
        if entry is not None:
            found[i] = entry
    return found


def _section(tables: dict[str, Any], name: str, kind: type[S], problems: list[Problem]) -> S:
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


def _tables_of(tables: dict[str, Any], name: str) -> list[dict[str, Any]]:
    value = tables.get(name)
    return [table for table in value if isinstance(table, dict)] if isinstance(value, list) else []


def _with_params(robot: dict[str, Any]) -> dict[str, Any]:
    """The table with the parameters of the behaviour collected under `params`."""
    ours = set(RobotEntry.__struct_fields__) - {"params"}
    return {key: value for key, value in robot.items() if key in ours} | {
        "params": {key: value for key, value in robot.items() if key not in ours}
    }
