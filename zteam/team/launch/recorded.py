"""What a recording holds of its team: the launch, the files that it reads, and a hash of each behaviour's source; and
that launch again, with its files, for another run."""

import hashlib
import inspect
import json
import os
from collections.abc import Mapping
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import msgspec

from zteam.config.resources import files_read
from zteam.errors import UsageError, ZteamError
from zteam.navigation.planning.maps import read_map
from zteam.navigation.planning.parameters import navigation_of_robot
from zteam.node.process_options import RecorderOptions
from zteam.robot.behaviors.registry import find_behavior, look_in
from zteam.simulator.world import load_world
from zteam.team.file.entries import behavior_of, navigation_of
from zteam.team.launch.plan import TeamLaunch, from_builtins
from zteam.transforms.urdf import read_description

LAUNCH = "launch.json"
FILES = "files/"
"""Before the names of the files, relative to the folder that holds all of them."""


class Recorded(msgspec.Struct):
    """The attachment LAUNCH."""

    launch: dict[str, Any]
    root: str
    """The folder that held all files."""
    sources: dict[str, str]
    """SHA-256 of the source of each behaviour and node, by its name."""


def contents_of(options: RecorderOptions) -> dict[str, bytes]:
    """The attachments of a recording, by name. Raises ZteamError."""
    if options.launch is None:
        return {}
    launch = from_builtins(options.launch)
    with files_read() as found:
        _read_all(launch)
    if launch.team_file is not None and launch.team_file.is_file():
        found.add(launch.team_file)
    paths = sorted({path.resolve() for path in found})
    root = os.path.commonpath([path.parent for path in paths]) if paths else "/"
    recorded = Recorded(options.launch, root, sources_of(launch))
    files = {f"{FILES}{path.relative_to(root).as_posix()}": path.read_bytes() for path in paths}
    # Python's own JSON, because it has infinity, as TOML has.
    return {LAUNCH: json.dumps(msgspec.to_builtins(recorded)).encode(), **files}


def _read_all(launch: TeamLaunch) -> None:
    team, folder = launch.team, launch.team_file.parent if launch.team_file else Path()
    if launch.world is not None:
        load_world(launch.world)
    if team.team.map:
        read_map(folder / team.team.map)
    for robot in team.robots:
        if robot.description:
            read_description(folder / robot.description)
        if (table := navigation_of(robot)) is not None:
            navigation_of_robot(table, robot.id, folder, f"robot {robot.id}, navigation")


def sources_of(launch: TeamLaunch) -> dict[str, str]:
    """A hash of the source file of each behaviour, by its name, and of each node's program that is a file."""
    found, team = dict[str, str](), launch.team
    look_in((*team.folders, ""))
    named = [behavior_of(robot)[0] for robot in team.driven] + [node.body for node in launch.own.values()]
    for spec in dict.fromkeys(named):
        module, is_users, _ = spec.partition(":")
        with suppress(ZteamError, ImportError, OSError, TypeError, ValueError):
            # A user's module is not imported here.
            own = find_spec(module) if is_users else None
            file = own.origin if own else inspect.getsourcefile(find_behavior(spec))
            found[spec] = _hash_of(Path(file or ""))
    for node in team.nodes:
        for word in node.command:
            path = Path(node.folder, word)
            if path.is_file():
                found[node.name] = _hash_of(path)
    return found


def _hash_of(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def world_of(contents: Mapping[str, bytes]) -> str:
    """The name of the world in a recording; empty where it does not say."""
    try:
        return Path(json.loads(contents[LAUNCH])["launch"]["world"]).stem
    except (KeyError, ValueError, TypeError):
        return ""


def restore(contents: Mapping[str, bytes], folder: Path) -> tuple[TeamLaunch, list[str]]:
    """The launch of a recording, whose files are written into `folder`, and the names of the behaviours and nodes whose
    source is another one now. Raises UsageError for what is no recording of a team."""
    try:
        recorded = msgspec.convert(json.loads(contents[LAUNCH]), Recorded)
        launch = from_builtins(recorded.launch)
    except KeyError:
        raise UsageError("it was recorded beside a running team, so it holds no team to run") from None
    except (ValueError, TypeError, msgspec.ValidationError, RecursionError) as error:
        raise UsageError(f"its team cannot be read: {error}") from None
    for name, data in contents.items():
        path = folder / name.removeprefix(FILES)
        if name.startswith(FILES) and path.resolve().is_relative_to(folder.resolve()):
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(data)

    def moved(path: Path | str) -> Path:
        """Where a file is now; one of the folders of behaviours stays."""
        relative = os.path.relpath(Path(path).resolve(), recorded.root)
        return folder / relative

    world = None if launch.world is None else moved(launch.world)
    file = moved(launch.team_file) if launch.team_file else None
    if file is not None:
        # Paths of the team are relative to it.
        file.parent.mkdir(parents=True, exist_ok=True)
    now = sources_of(launch)
    changed = [name for name, source in recorded.sources.items() if now.get(name, "") != source]
    return msgspec.structs.replace(launch, world=world, team_file=file), changed
