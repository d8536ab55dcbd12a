"""Checks a team file against everything it names, before any process starts, and reports all mistakes at once.

The check covers behaviours and their parameters, robot descriptions, and ids and poses in the world. A child process
imports the user's own modules; behaviours of zteam are checked here, because that takes a tenth of a second.
"""

import os
import re
import shutil
from codecs import BOM_UTF8
from collections.abc import Callable, Generator, Iterator, Mapping
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import TypeVar

from zteam import names
from zteam.config.problems import Problem
from zteam.config.resources import existing_file, is_folder
from zteam.config.robot_ids import format_robot_ids
from zteam.errors import ConfigError, UsageError, WorldError
from zteam.robot.behaviors.registry import BEHAVIORS
from zteam.simulator.world import add_robot, load_world
from zteam.simulator.world.devices import KINDS
from zteam.simulator.world.model import Robot, World
from zteam.simulator.world.placing import MAX_MAP_CELLS, find_hindrance, map_metadata
from zteam.team.file.entries import RobotEntry, behavior_of, navigation_of
from zteam.team.file.groups import GROUP_KEYS
from zteam.team.file.reading import TeamFile, team_world
from zteam.team.file.sources import error_of
from zteam.team.launch.own_behaviors import Answer, Question, answer, asking
from zteam.team.launch.plan import PYTHON, is_own

_ROBOT_KEYS = (*(name for name in RobotEntry.__struct_fields__ if name != "params"), *GROUP_KEYS)


def check_team(file: TeamFile, world_file: Path | None = None, *, here: bool = False) -> Path | None:
    """The world of the team, None for real robots; `world_file` replaces the world of the team file. With `here` this
    process imports the user's modules: it runs the team itself, and may have made a module. Raises ConfigError of one
    line for each mistake, in the team file or in the world's."""
    if not file.is_filled:
        raise error_of(file.mistakes)
    problems, told = list[Problem](), []
    name, robots = "", dict[int, Robot]()
    driven = {i: entry for i, entry in file.robots.items() if entry.has_process}
    own = {i: entry for i, entry in driven.items() if not here and behavior_of(entry)[0] not in BEHAVIORS}
    with asking([_question(entry) for entry in own.values()], file.team.folders) as wait:
        answers = {i: answer(_question(entry)) for i, entry in driven.items() if i not in own}
        try:
            # A missing world may be a misspelt key, which is told already.
            is_told = not file.team.team.world and any(each.place.path[:1] == ("team",) for each in file.mistakes)
            if world_file is None and not is_told:
                world_file = team_world(file)
            if world_file is not None:
                name = world_file.name
                problems += _world_problems(file, load_world(world_file), name, robots)
        except (ConfigError, WorldError) as error:
            told.append(str(error))
        answers |= zip(own, wait(), strict=True)
    problems += [Problem(("robots", i, "behavior"), each.refused) for i, each in answers.items() if each.refused]
    problems += [Problem(("robots", i, *path), text) for i, each in answers.items() for path, text in each.mistakes]
    problems += [*_file_problems(file), *_node_problems(file)]
    problems += _sensor_problems(file, name, robots, answers)
    mistakes = [*file.mistakes, *file.table.locate(problems)]
    if mistakes:
        told.insert(0, str(error_of(mistakes)))
    if told:
        raise ConfigError("\n".join(told))
    return world_file


def _question(entry: RobotEntry) -> Question:
    spec, params = behavior_of(entry)
    # The rules of team files check the leaders.
    if spec == "follow":
        params = {"leader": 0, **params}
    elif entry.behavior is None:
        params = {key: value for key, value in params.items() if key != "leader"}
    return Question(spec, params, list(_ROBOT_KEYS))


T = TypeVar("T")


def _refused(path: tuple[str | int, ...], read: Callable[[], T]) -> Generator[Problem, None, T | None]:
    """One problem at `path` for each mistake that `read()` raises; returns what it returns."""
    try:
        return read()
    except UsageError as error:
        yield from (Problem(path, line.removeprefix(": ")) for line in str(error).splitlines())
    return None


def _file_problems(file: TeamFile) -> Iterator[Problem]:
    """Parameters of a navigation with wrong types, here or in a parameter file; descriptions and the map in place of
    the simulator's own that cannot be used. Imports are inside, because few teams have these."""
    folder, cell = file.path.parent, file.team.simulation.map_resolution
    if file.team.team.map is not None:
        from zteam.config.map_files import read_map_file

        found = yield from _refused(("team", "map"), partial(read_map_file, folder / file.team.team.map))
        cell = found.resolution if found else cell
    for i, entry in file.robots.items():
        if (table := navigation_of(entry)) is not None:
            from zteam.navigation.planning.parameters import navigation_of_robot

            read = partial(navigation_of_robot, table, entry.id, folder, "", cell)
            yield from _refused(("robots", i, "navigation"), read)
        if entry.description is not None:
            from zteam.transforms.urdf import read_description

            yield from _refused(("robots", i, "description"), partial(read_description, folder / entry.description))


def _node_problems(file: TeamFile) -> Iterator[Problem]:
    """Programs, scripts and folders that are not there."""
    for i, node in file.nodes.items():
        folder, (program, *arguments) = Path(node.folder), node.command
        if not is_folder(folder):
            yield Problem(("nodes", i, "folder"), f"there is no folder {folder}")
        elif program in PYTHON:
            script = arguments[0] if arguments else ""
            if script.endswith(".py") and existing_file(folder / script) is None:
                yield Problem(("nodes", i, "command", 1), f"there is no file {script!r} in {folder}")
        elif not is_own(program) and (text := _program_fault(folder, program)):
            yield Problem(("nodes", i, "command", 0), text)


def _program_fault(folder: Path, program: str) -> str:
    """Why a program cannot be started in this folder, and the way out; empty if nothing is known against it."""
    beside, is_path = folder / program, os.sep in program
    # No system takes a NUL.
    found = None if "\0" in program else shutil.which(beside if is_path else program)
    by_python = f'command = ["python", "{program}", …]'
    if found is not None:
        return _format_fault(Path(found), by_python)
    if is_path and is_folder(beside):
        return f"{beside} is a folder: name the program in it"
    if existing_file(beside) is None:
        return f"there is no program {program!r} {f'in {folder}' if is_path else 'on PATH'}"
    if not is_path:
        return f'there is no program {program!r} on PATH; the file in {folder} is "./{program}", or {by_python}'
    return f"{beside} has no right to be executed: give it with 'chmod +x', or start a script by {by_python}"


def _format_fault(path: Path, by_python: str) -> str:
    """Why the system does not take a file with the right to be executed as a program."""
    # One that may be executed and not read is none of these.
    line = b"\0"
    with suppress(OSError), path.open("rb") as file:
        line = file.readline(1024)
    if line.startswith(b"MZ") and not Path("/proc/sys/fs/binfmt_misc/WSLInterop").exists():
        return f"{path} is a program for Windows"
    if line.startswith((b"#!", BOM_UTF8 + b"#!")):
        if line.startswith(BOM_UTF8) or line.endswith(b"\r\n"):
            mark = "a byte order mark" if line.startswith(BOM_UTF8) else "Windows line ends"
            return f"{path} has {mark}, so its first line names no program: save it as text of Unix, UTF-8 without mark"
        is_there = existing_file(path.parent / (os.fsdecode(line[2:]).split() or [""])[0])
        return "" if is_there else f"the first line of {path} names a program that is not there"
    if all(byte >= 32 or byte in b"\t\r\n" for byte in line):
        return f"{path} is no program: begin a script with a line such as '#!/usr/bin/env python3', or say {by_python}"
    return ""


def refuse_nodes(file: TeamFile, way_out: str) -> None:
    """Raise ConfigError if a team that no other process can reach has nodes."""
    text = f"a node is a process, which cannot reach a team in one process: {way_out}"
    if file.nodes:
        raise file.error([Problem(("nodes", i, "command"), text) for i in file.nodes])


def _world_problems(file: TeamFile, world: World, name: str, robots: dict[int, Robot]) -> Iterator[Problem]:
    """A world too large for its map. Robots that the world in the file `name` does not have, that it has already, or
    that have no room in it; `robots` gets all that will stand in it, by id."""
    if file.team.team.map is None:
        size = partial(map_metadata, world, file.team.simulation.map_resolution, MAX_MAP_CELLS)
        yield from _refused(("simulation", "map_resolution"), size)
    standing = dict(enumerate(world.robots)) if file.team.team.world_robots else {}
    robots.update(standing)
    ids = {entry.id for entry in file.robots.values()}
    for i, entry in file.robots.items():
        if entry.pose is None or entry.model is None:
            if entry.id in standing:
                robot = standing[entry.id]
                # Of two robots of the team only the second is told.
                others = {j: other for j, other in standing.items() if j < entry.id or j not in ids}
                if hindrance := find_hindrance(world, robot, others):
                    text = f"at its pose in {name} robot {entry.id} {hindrance}; give {robot.name!r} a free pose there"
                    yield Problem(("robots", i, "id"), text)
            elif not (entry.pose or entry.model):
                text = f"the world has no robot {entry.id} (it has {format_robot_ids(standing) or 'none'})"
                yield Problem(("robots", i, "id"), f"{text}; model and pose add one")
        elif entry.id in robots:
            text = f"the world has a robot {entry.id} already: leave model and pose out, or give another id"
            yield Problem(("robots", i, "id"), text)
        else:
            try:
                robot = add_robot(world, entry.model, entry.pose, names.robot_name(entry.id))
            except WorldError as error:
                yield Problem(("robots", i, "model"), str(error))
                continue
            if hindrance := find_hindrance(world, robot, robots):
                yield Problem(("robots", i, "pose"), f"it {hindrance}; give a free place as x, y, yaw")
            robots[entry.id] = robot


def _sensor_problems(
    file: TeamFile, world: str, robots: Mapping[int, Robot], answers: Mapping[int, Answer]
) -> Iterator[Problem]:
    """Robots of the world file `world` without a sensor that their behaviour needs, and cars that are to navigate."""
    for i, answered in answers.items():
        entry = file.robots[i]
        robot = robots.get(entry.id)
        if robot is None:
            continue
        if robot.drive == "car" and navigation_of(entry) is not None:
            text = f"robot {entry.id} is a car, and navigation turns on the spot: give it a model with drive 'diff' or"
            yield Problem(("robots", i, "navigation"), f"{text} 'omni', or let it wander or follow without navigation")
        # No robot drives without a laser. The rest may come from a process of the user's own.
        needed = [names.BASE_SCAN, *(() if file.nodes else answered.topics)]
        published = {kind.key(entry.id, n) for kind in KINDS.values() for n in range(kind.count(robot))}
        for topic in dict.fromkeys(needed):
            owner, own_topic = names.split_robot_key(names.input_key(entry.id, topic)) or (None, "")
            kind = KINDS.get(re.sub(r"_\d+$", "", own_topic))
            if kind and owner == entry.id and names.robot_key(entry.id, own_topic) not in published:
                text = f"{behavior_of(entry)[0]} needs {topic}, but robot {entry.id} carries no {kind.title} for it"
                way_out = f"add one to {robot.name!r} (model {robot.model}) in {world}, or give it another model"
                yield Problem(("robots", i, "behavior" if entry.follow is None else "follow"), f"{text}: {way_out}")
