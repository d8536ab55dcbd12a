"""Team files: TOML read into structs that forbid unknown fields (DESIGN section 6).

Every error is a ConfigError of one line: file, key path and the fix.
"""

import json
import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, get_args

import msgspec

from zteam import names, shipped
from zteam.errors import ConfigError
from zteam.geometry import Pose2, quaternion_from_rpy
from zteam.messages import Header, Quaternion, Transform, TransformStamped, Vector3
from zteam.simulation import Options

NO_WORLD = "none"
"""`world = "none"`: real robots, no simulator."""

RobotId = Annotated[int, msgspec.Meta(ge=0, le=names.MAX_ROBOT_ID)]
# argparse and the engine take any whole number, but 64 bits are what a TOML file has to promise.
Seed = Annotated[int, msgspec.Meta(ge=0, le=2**63 - 1)]
Text = Annotated[str, msgspec.Meta(min_length=1)]


class TeamSection(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The table [team]."""

    world: Text | None = None
    """A path relative to the file, the name of a shipped world, or "none"; without it the user has to say --world."""
    seed: Seed = 1
    world_robots: bool = True
    """Whether the world's own robots are in it, or only those that the team adds with a `pose`."""


class RobotEntry(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One [[robots]] table."""

    id: RobotId
    behavior: Text | None = None
    follow: RobotId | None = None
    model: Text | None = None
    """With `pose`: add such a robot, which the world lacks."""
    pose: Pose2 | None = None
    description: Text | None = None
    """A URDF file, beside the team file: the aggregator says its joints."""
    params: dict[str, Any] = {}
    """Every other key of the table: the behaviour's parameters, raw; the behaviour checks them."""


class StaticTransform(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One [[static_transforms]] table: the pose of `child` in `parent`, metres and radians."""

    parent: Text
    child: Text
    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    yaw: float = 0.0
    pitch: float = 0.0
    roll: float = 0.0
    qx: float | None = None
    qy: float | None = None
    qz: float | None = None
    qw: float | None = None


class Team(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A whole team file."""

    robots: list[RobotEntry]
    team: TeamSection = TeamSection()
    static_transforms: list[StaticTransform] = []
    simulation: Options = Options()


def load_team(path: Path) -> Team:
    """The team file at `path`. Raises ConfigError."""
    try:
        return _checked(path, _read(path))
    except RecursionError:
        raise ConfigError(f"{path}: nested too deeply for a team file") from None


def team_world(path: Path, team: Team) -> Path | None:
    """The world file that the team file at `path` asks for, None for real robots. Raises ConfigError."""
    world = team.team.world
    if world is None:
        raise ConfigError(f'{path}: $.team.world is not given: say --world FILE, or world = "office" in [team]')
    if world == NO_WORLD:
        return None
    beside = path.parent / world
    try:
        found = beside if beside.is_file() else shipped.shipped_world(world)
    except (OSError, ValueError):
        # No name of a file at all: too long, or with a NUL in it.
        found = None
    if found is None:
        known = ", ".join(shipped.names(shipped.worlds_folder(), ".world"))
        raise ConfigError(f"{path}: $.team.world: {world!r} is neither a file beside it nor a shipped world ({known})")
    return found


def robot_arguments(entry: RobotEntry) -> list[str]:
    """The arguments of `zteam-robot` that make this robot."""
    arguments = ["--id", str(entry.id)]
    if entry.follow is not None:
        arguments += ["--follow", str(entry.follow)]
    elif entry.behavior is not None:
        arguments += ["--behavior", entry.behavior]
    for key, value in entry.params.items():
        arguments += ["--param", f"{key}={_toml(value)}"]
    return arguments


def static_transform(entry: StaticTransform) -> TransformStamped:
    """The message that publishes it, its stamp 0 and its quaternion normalised."""
    given = _quaternion(entry)
    if given:
        norm = math.hypot(*given)
        rotation = Quaternion(*(q / norm for q in given))
    else:
        rotation = Quaternion(*quaternion_from_rpy(entry.roll, entry.pitch, entry.yaw))
    return TransformStamped(
        Header(frame_id=names.strip_slash(entry.parent)),
        names.strip_slash(entry.child),
        Transform(Vector3(entry.x, entry.y, entry.z), rotation),
    )


def explain(error: msgspec.ValidationError) -> str:
    """msgspec's sentence with the place in front: `$.robots[0].id: Expected ...`."""
    text, at, place = " ".join(str(error).split()).rpartition(" - at `")
    return f"{place.removesuffix('`')}: {text}" if at else f"$: {place}"


def _checked(path: Path, tables: dict[str, Any]) -> Team:
    robots = tables.get("robots")
    if isinstance(robots, list):
        tables["robots"] = [_with_params(robot) for robot in robots]
    try:
        team = msgspec.convert(tables, Team)
    except msgspec.ValidationError as error:
        raise ConfigError(f"{path}: {explain(error)}{_hint(error)}") from None
    for check in (_check_robots, _check_follows, _check_transforms):
        trouble = check(team)
        if trouble:
            raise ConfigError(f"{path}: {trouble}")
    return team


def _read(path: Path) -> dict[str, Any]:
    import tomllib

    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ConfigError(f"{path}: cannot read the team file: {error.strerror or error}") from None
    except UnicodeDecodeError as error:
        raise ConfigError(f"{path}: not UTF-8 text (byte {error.start}); save it as UTF-8") from None
    except tomllib.TOMLDecodeError as error:
        found = re.search(r" \(at line (\d+), column (\d+)\)$", str(error))
        place = f"{path}:{found[1]}:{found[2]}" if found else f"{path}"
        raise ConfigError(f"{place}: not TOML: {str(error)[: found.start()] if found else error}") from None
    except ValueError as error:
        # A number of thousands of digits.
        raise ConfigError(f"{path}: not a team file: {' '.join(str(error).split())}") from None


def _with_params(robot: Any) -> Any:
    """The table with the behaviour's parameters gathered under `params`."""
    if not isinstance(robot, dict):
        return robot
    ours = set(RobotEntry.__struct_fields__) - {"params"}
    return {key: value for key, value in robot.items() if key in ours} | {
        "params": {key: value for key, value in robot.items() if key not in ours}
    }


def _hint(error: msgspec.ValidationError) -> str:
    """What the user may have meant: what the table takes where a key is misspelt or missing."""
    text = str(error)
    if text.startswith("Expected `array`, got `object`"):
        return "; a table of a list is written with two brackets, as in [[robots]]"
    if "enum value" in text:
        field = Options.__annotations__.get(text.partition("`$.simulation.")[2].rstrip("`"))
        choices = [choice for part in get_args(field) for choice in (get_args(part) or (part,))]
        return f"; one of {', '.join(c for c in choices if isinstance(c, str))}" if choices else ""
    if "field" not in text:
        return ""
    kinds: tuple[tuple[str, type[msgspec.Struct]], ...] = (
        ("$.team", TeamSection),
        ("$.robots", RobotEntry),
        ("$.static_transforms", StaticTransform),
        ("$.simulation", Options),
    )
    kind = next((kind for start, kind in kinds if f"`{start}" in text), Team)
    return f"; known: {', '.join(f for f in kind.__struct_fields__ if f != 'params')}"


def _check_robots(team: Team) -> str:
    if not team.robots:
        return "$.robots is empty: add a table [[robots]] with an id"
    seen: dict[int, int] = {}
    for i, robot in enumerate(team.robots):
        place = f"$.robots[{i}]"
        if robot.id in seen:
            return f"{place}.id: robot {robot.id} is $.robots[{seen[robot.id]}] already; give each robot its own id"
        seen[robot.id] = i
        if (robot.model is None) != (robot.pose is None):
            return f"{place}: model and pose go together (they add a robot that the world lacks); give both or neither"
        if robot.pose is not None and not all(map(math.isfinite, robot.pose)):
            return f"{place}.pose: {_toml(robot.pose)} is no pose; give finite x, y, yaw"
        trouble = _check_params(place, robot)
        if trouble:
            return trouble
    return ""


def _check_params(place: str, robot: RobotEntry) -> str:
    for key, value in robot.params.items():
        if not key.isidentifier():
            return f"{place}: {key!r} cannot be a parameter; use letters, digits and '_'"
        try:
            _toml(value)
        except TypeError:
            return f"{place}.{key}: a parameter is a number, text, true, false, or an array or table of such"
    return ""


def _check_follows(team: Team) -> str:
    leaders = {robot.id: robot.follow for robot in team.robots}
    for i, robot in enumerate(team.robots):
        place = f"$.robots[{i}]"
        if robot.follow is None:
            if robot.behavior == "follow":
                return f'{place}: behavior = "follow" needs a leader; say follow = ID instead'
            continue
        if robot.behavior not in (None, "follow"):
            return f"{place}: both follow and behavior = {_toml(robot.behavior)}; keep one of them"
        if "leader" in robot.params:
            return f"{place}.leader: the leader is named by follow = {robot.follow}; drop the other key"
        if robot.follow == robot.id:
            return f"{place}.follow: robot {robot.id} cannot follow itself; name another robot"
        if robot.follow not in leaders:
            known = ", ".join(map(str, sorted(leaders)))
            return f"{place}.follow: no robot {robot.follow} in this file (it has {known})"
        cycle = _cycle_from(robot.id, leaders)
        if cycle:
            return f"{place}.follow: robots follow each other in a circle ({cycle}); let one of them lead"
    return ""


def _cycle_from(robot_id: int, leaders: Mapping[int, int | None]) -> str:
    """`1 → 2 → 1` where `robot_id` is part of a circle, else empty."""
    chain = [robot_id]
    leader = leaders.get(robot_id)
    while leader is not None and leader not in chain:
        chain.append(leader)
        leader = leaders.get(leader)
    return " → ".join(map(str, [*chain, robot_id])) if leader == robot_id else ""


def _check_transforms(team: Team) -> str:
    placed: dict[str, int] = {}
    for i, entry in enumerate(team.static_transforms):
        place = f"$.static_transforms[{i}]"
        parent, child = names.strip_slash(entry.parent), names.strip_slash(entry.child)
        if not parent or not child or parent == child:
            return f"{place}: parent and child must be the names of two frames"
        if child in placed:
            return f"{place}.child: $.static_transforms[{placed[child]}] says where {child} is; keep one of them"
        placed[child] = i
        trouble = _check_numbers(entry)
        if trouble:
            return f"{place}{trouble}"
    return ""


def _check_numbers(entry: StaticTransform) -> str:
    for field in ("x", "y", "z", "yaw", "pitch", "roll", "qx", "qy", "qz", "qw"):
        value = getattr(entry, field)
        if value is not None and not math.isfinite(value):
            return f".{field}: {value} is no number to place a frame with"
    if all(q is None for q in (entry.qx, entry.qy, entry.qz, entry.qw)):
        return ""
    given = _quaternion(entry)
    if not given:
        return ": a quaternion needs all of qx, qy, qz, qw"
    if entry.yaw or entry.pitch or entry.roll:
        return ": both a quaternion and yaw, pitch, roll; keep one of them"
    # Tiny or huge ones cannot be normalised without loss; people write unit quaternions, give or take rounding.
    if not 0.9 < math.hypot(*given) < 1.1:
        return ": qx, qy, qz, qw is no rotation: its length is not 1"
    return ""


def _quaternion(entry: StaticTransform) -> tuple[float, float, float, float] | None:
    if entry.qx is None or entry.qy is None or entry.qz is None or entry.qw is None:
        return None
    return entry.qx, entry.qy, entry.qz, entry.qw


def _toml(value: Any) -> str:
    """The value as TOML on one line. Raises TypeError for what zteam-robot cannot be given, such as a date."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float) or (isinstance(value, int) and abs(value) < 2**63):
        return repr(value)
    if isinstance(value, str):
        # JSON's texts are TOML's, but for DEL, which TOML wants escaped.
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{_toml(key)} = {_toml(item)}" for key, item in value.items()) + "}"
    if isinstance(value, Sequence):
        return "[" + ", ".join(map(_toml, value)) + "]"
    raise TypeError(value)
