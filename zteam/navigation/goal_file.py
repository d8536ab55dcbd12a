"""A file of goals: a YAML list of `{robot, x, y, yaw}`."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from zteam import names
from zteam.config.resources import read_file
from zteam.errors import ConfigError, UsageError, did_you_mean
from zteam.geometry import FAR, Pose2, turn_problem

if TYPE_CHECKING:
    import yaml

MAX_BYTES = 2 * 2**20
_EXAMPLE = "{robot: 1, x: 3.0, y: 4.0, yaw: 1.57}"
_KEYS = ("robot", "x", "y", "yaw")


class FileGoal(NamedTuple):
    """One goal."""

    robot: int | None
    """None: any robot of those that share the goals."""
    pose: Pose2
    """In map."""
    line: int


def read_goals(path: Path, *, spread: bool = False) -> list[FileGoal]:
    """The goals of a file, in their order. Raises ConfigError with a line for each mistake.

    With `spread` a goal needs no robot.
    """
    import yaml

    data = read_file(path, "file of goals", MAX_BYTES, ConfigError)
    try:
        # The pure loader: that of C counts no lines where it meets a mistake of its own.
        root = yaml.compose(data.decode("utf-8-sig"), yaml.SafeLoader)
    except yaml.MarkedYAMLError as error:
        place = f"{path}:{error.problem_mark.line + 1}" if error.problem_mark else f"{path}"
        raise ConfigError(f"{place}: not YAML: {error.problem or error.context}") from None
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise ConfigError(f"{path}: not YAML: {' '.join(str(error).split()):.200}") from None
    if not isinstance(root, yaml.SequenceNode) or not root.value:
        line = 1 if root is None else _line(root)
        raise ConfigError(f"{path}:{line}: a list of goals is expected, such as - {_EXAMPLE}")
    mistakes: list[tuple[int, str]] = []
    goals = [_read_goal(node, spread, mistakes) for node in root.value]
    if mistakes:
        raise ConfigError("\n".join(f"{path}:{line}: {text}" for line, text in sorted(mistakes)))
    return [goal for goal in goals if goal is not None]


def _line(node: "yaml.Node") -> int:
    return int(node.start_mark.line) + 1


def _read_goal(node: "yaml.Node", spread: bool, mistakes: list[tuple[int, str]]) -> FileGoal | None:
    """One goal, and what is wrong with it by line; None if it is unusable."""
    import yaml

    if not isinstance(node, yaml.MappingNode):
        mistakes.append((_line(node), f"a goal is expected, such as {_EXAMPLE}"))
        return None
    found: dict[str, Any] = {}
    for key, value in node.value:
        name = str(key.value)
        if name not in _KEYS:
            known = ", ".join(_KEYS)
            mistakes.append((_line(key), f"unknown key {name!r}{did_you_mean(name, _KEYS)}; known: {known}"))
        elif name in found:
            mistakes.append((_line(key), f"{name} is given twice"))
        else:
            found[name] = None
            try:
                found[name] = _value(name, value)
            except UsageError as error:
                mistakes.append((_line(value), f"{name}: {error}"))
    for name in _KEYS[1:3] if spread else _KEYS[:3]:
        if name not in found:
            hint = ", or name the robots that share the goals: --spread 0-3" if name == "robot" else ""
            mistakes.append((_line(node), f"the key {name} is missing{hint}"))
    if mistakes:
        return None
    return FileGoal(found.get("robot"), Pose2(found["x"], found["y"], found.get("yaw", 0.0)), _line(node))


def _value(name: str, node: "yaml.Node") -> Any:
    """A key's value. Raises UsageError."""
    text = node.value if isinstance(node.value, str) else ""
    if name == "robot":
        robot_id = names.robot_id_of(text)
        return names.parse_robot_id(text) if robot_id is None else robot_id
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not abs(number) <= FAR:
        unit = "radians" if name == "yaw" else "metres in the map"
        raise UsageError(f"{text or 'this'!s:.40} is no number of {unit}")
    if name == "yaw" and (problem := turn_problem(number)):
        raise UsageError(problem)
    return number
