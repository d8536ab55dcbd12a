"""From the merged table of a team file to typed entries: every mistake with its file and line.

One direction: files (`sources`), one table a robot (`groups`), typed entries (`entries`), the rules that they obey
together.
"""

from collections.abc import Collection, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any, TypeVar

import msgspec

from zteam import names
from zteam.config import resources
from zteam.config.problems import Problem, problems_of
from zteam.config.robot_ids import circle_from, format_robot_ids
from zteam.config.simulation_options import Options
from zteam.config.toml_values import toml_text
from zteam.errors import ConfigError, UsageError
from zteam.team.file.entries import (
    GRANTS,
    NO_WORLD,
    NodeEntry,
    RobotEntry,
    Security,
    StaticTransform,
    Team,
    TeamSection,
)
from zteam.team.file.groups import Expansion
from zteam.team.file.sources import LISTS, Argument, Files, Mistake, Table, error_of

S = TypeVar("S", bound=msgspec.Struct)


class Tables(msgspec.Struct, forbid_unknown_fields=True):
    """The keys of a team file."""

    robots: Annotated[list[dict[str, Any]], msgspec.Meta(min_length=1)] = []
    team: dict[str, Any] = {}
    nodes: list[dict[str, Any]] = []
    defaults: dict[str, Any] = {}
    static_transforms: list[dict[str, Any]] = []
    simulation: dict[str, Any] = {}
    security: dict[str, Any] = {}
    include: Any = None
    """It is read with each file."""


class TeamFile(msgspec.Struct):
    """The correct part of a team file and of what it includes, and all mistakes."""

    path: Path
    team: Team
    robots: dict[int, RobotEntry]
    """The team's robots by their index in the expanded team, without those that have mistakes."""
    nodes: dict[int, NodeEntry]
    """Its nodes in the same way."""
    table: Table
    """The expanded team."""
    mistakes: list[Mistake]
    arguments: list[Argument]
    """What it takes."""
    is_filled: bool
    """Whether none of them is missing. Otherwise that is all that is told: other values are not known."""

    def error(self, problems: Iterable[Problem]) -> ConfigError:
        """An error with one line per problem of the expanded team."""
        return error_of(self.table.locate(problems))


def load_team(path: Path, arguments: Mapping[str, str] | None = None) -> Team:
    """The team file at `path`. Raises ConfigError with one line for each mistake in it.

    `arguments` are TOML, or texts without quotes, by name.
    """
    file = read_team_file(path, arguments)
    if file.mistakes:
        raise error_of(file.mistakes)
    return file.team


def read_team_file(path: Path, arguments: Mapping[str, str] | None = None) -> TeamFile:
    """The team file at `path` with the mistakes in its keys. Raises ConfigError if a file is not TOML."""
    files = Files(arguments or {})
    return _read_entries(files, files.gather(path))


def read_team_tables(name: str, tables: Mapping[str, Any]) -> TeamFile:
    """A team that a program gives as tables, with the mistakes in them; errors call it `name`."""
    files = Files({})
    return _read_entries(files, files.adopt(name, tables))


def set_map_resolution(file: TeamFile, metres: float | None) -> None:
    """Let cells of the simulator's map have this size, not the team file's; None changes nothing. Raises ValueError."""
    if metres is not None:
        simulation = msgspec.structs.replace(file.team.simulation, map_resolution=metres)
        file.team = msgspec.structs.replace(file.team, simulation=simulation)


def team_world(file: TeamFile) -> Path | None:
    """The world file that a team file asks for, None for real robots. Raises ConfigError."""
    world = file.team.team.world
    if world is None:
        text = 'the key world is missing: say --world FILE, or world = "office" in [team]'
        raise file.error([Problem(("team",), text)])
    if world == NO_WORLD:
        return None
    try:
        return resources.find_world(world, file.path.parent)
    except UsageError as error:
        raise file.error([Problem(("team", "world"), str(error))]) from None


def _read_entries(files: Files, table: Table) -> TeamFile:
    problems = problems_of(table, Tables)
    if "robots" not in table and not table.get("nodes"):
        problems.append(Problem((), "the key robots is missing"))
    for i, (path, _) in enumerate(problems):
        name = path[0] if path else ""
        if name in LISTS and isinstance(table[name], Table):
            told = f"a list of tables is expected, written with two brackets, as in [[{name}]]"
            problems[i] = Problem(path, told)
    # A key that is missing may be one that is misspelt.
    mistakes = [*files.mistakes, *table.locate(each for each in problems if each.path or len(problems) == 1)]
    ids_known = isinstance(table.get("robots"), list)
    for name in LISTS:
        listed = table[name] if isinstance(table.get(name), list) else []
        table.put(name, [each for each in listed if isinstance(each, Table)], table.place_of(name))
    expansion = Expansion(table)
    mistakes += expansion.mistakes
    table.put("robots", expansion.robots, table.place_of("robots"))
    problems = []
    robots = _array(table, "robots", RobotEntry, problems)
    nodes = _array(table, "nodes", NodeEntry, problems)
    transforms = _array(table, "static_transforms", StaticTransform, problems)
    for i, entry in nodes.items():
        folder = table.place_of("nodes", i).source.path.parent / entry.folder
        nodes[i] = msgspec.structs.replace(entry, folder=str(folder.absolute()))
    ids = {robot["id"] for robot in table["robots"] if isinstance(robot.get("id"), int)}
    problems += _check_follows(robots, ids if ids_known and expansion.ids_known else None)
    problems += [*_check_nodes(nodes, ids), *_check_transforms(transforms)]
    security = _section(table, "security", Security, problems)
    problems += _check_grants(security)
    team = Team(
        robots=list(robots.values()),
        nodes=list(nodes.values()),
        static_transforms=list(transforms.values()),
        team=_section(table, "team", TeamSection, problems),
        simulation=_section(table, "simulation", Options, problems),
        security=security,
        folders=tuple(dict.fromkeys(str(source.path.parent.resolve()) for source in files.sources)),
    )
    file = TeamFile(files.sources[0].path, team, robots, nodes, table, mistakes, files.arguments, not files.missing)
    file.mistakes = files.missing or [*mistakes, *file.table.locate(problems)]
    return file


def _array(table: Table, name: str, kind: type[S], problems: list[Problem]) -> dict[int, S]:
    """The correct entries of a [[name]] array, by index."""
    found = {}
    for i, inner in enumerate(table[name]):
        plain = _with_params(inner) if kind is RobotEntry else _with_words(inner)
        wrong = problems_of(plain, kind, (name, i))
        problems += wrong
        if not wrong:
            found[i] = msgspec.convert(plain, kind)
    return found


def _section(table: Table, name: str, kind: type[S], problems: list[Problem]) -> S:
    """The correct part of a [name] table."""
    section = table.get(name, {})
    problems += problems_of(section, kind, (name,))
    keys = section.items() if isinstance(section, dict) else ()
    return msgspec.convert({key: value for key, value in keys if not problems_of({key: value}, kind)}, kind)


def _with_params(robot: Mapping[str, Any]) -> dict[str, Any]:
    """The table with the parameters of the behaviour collected under `params`."""
    ours = set(RobotEntry.__struct_fields__) - {"params"}
    own = {key: value for key, value in robot.items() if key in ours}
    return {**own, "params": {key: value for key, value in robot.items() if key not in ours}}


def _with_words(node: Mapping[str, Any]) -> dict[str, Any]:
    """The table with the numbers and truth values in its command as texts: an argument may be one."""
    command = node.get("command")
    if not isinstance(command, list):
        return {**node}
    are_numbers = [isinstance(part, float) or (isinstance(part, int) and abs(part) < 2**63) for part in command]
    words = [toml_text(part) if is_number else part for part, is_number in zip(command, are_numbers, strict=True)]
    return {**node, "command": words}


def _check_follows(robots: Mapping[int, RobotEntry], ids: Collection[int] | None) -> Iterator[Problem]:
    """Problems of leaders and followers; `ids` are all ids of the team, also those of tables with mistakes.

    None: some ids could not be read.
    """
    leaders = {robot.id: robot.follow for robot in robots.values()}
    circles: set[int] = set()
    for i, robot in robots.items():
        text = ""
        if robot.follow is not None and ids is not None and robot.follow not in ids:
            text = f"no robot {robot.follow} in this team (it has {format_robot_ids(ids)})"
        elif robot.id not in circles and (circle := circle_from(robot.id, leaders)):
            circles.update(circle)
            text = f"robots follow each other in a circle ({' → '.join(map(str, circle))}); let one of them lead"
        if text:
            yield Problem(("robots", i, "follow"), text)


def _check_nodes(nodes: Mapping[int, NodeEntry], ids: Collection[int]) -> Iterator[Problem]:
    """Problems of the names of nodes; `ids` are the ids of the team's robots."""
    seen: dict[str, int] = {}
    for i, node in nodes.items():
        text = names.name_problem(node.name)
        if names.is_taken(node.name) or {names.robot_id_of(node.name), names.navigated_robot_of(node.name)} & {*ids}:
            text = f"{node.name} is a process of the team already; give the node another name"
        elif (first := seen.setdefault(node.name, i)) != i:
            text = f"nodes[{first}] has this name already; give each node its own"
        if text:
            yield Problem(("nodes", i, "name"), text)


def _check_grants(security: Security) -> Iterator[Problem]:
    """Problems of the names of certificates, and of what they are granted."""
    for name, words in security.grants.items():
        text = names.name_problem(name)
        if not (isinstance(words, list) and all(word in GRANTS for word in words)):
            text = f"a list of these words is expected: {', '.join(GRANTS)}"
        if text:
            yield Problem(("security", "grants", name), text)


def _check_transforms(transforms: Mapping[int, StaticTransform]) -> Iterator[Problem]:
    """A frame has one place."""
    seen: dict[str, int] = {}
    for i, entry in transforms.items():
        if (first := seen.setdefault(names.strip_slash(entry.child), i)) != i:
            text = f"static_transforms[{first}] says where {entry.child} is; keep one of them"
            yield Problem(("static_transforms", i, "child"), text)
