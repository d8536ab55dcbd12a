"""Files of goals: a YAML list of `{robot, x, y, yaw}`. Every mistake is told with its line."""

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from zteam import names
from zteam.errors import ConfigError, UsageError, did_you_mean
from zteam.geometry import Pose2, turn_problem

if TYPE_CHECKING:
    import yaml

FAR = 1e6
"""Metres: no goal lies further from the origin of the map."""
MAX_BYTES = 2 * 2**20
_KEYS = ("robot", "x", "y", "yaw")


class FileGoal(NamedTuple):
    """One goal of a file."""

    robot: int | None
    """None: any robot of those that share the goals."""
    pose: Pose2
    """In map."""
    line: int


class _Mistake(NamedTuple):
    line: int
    text: str


def read_goals(path: Path, *, spread: bool = False) -> list[FileGoal]:
    """The goals of a file, in their order. Raises ConfigError with a line for each mistake.

    With `spread` a goal needs no robot.
    """
    import yaml

    try:
        with path.open("rb") as file:
            text = file.read(MAX_BYTES + 1)
        if len(text) > MAX_BYTES:
            raise ConfigError(f"{path}: a file of goals of more than {MAX_BYTES // 2**20} MB is refused")
        # The pure loader: that of C counts no lines where it meets a mistake of its own.
        root = yaml.compose(text.decode("utf-8-sig"), yaml.SafeLoader)
    except OSError as error:
        raise ConfigError(f"{path}: cannot read the goals: {error.strerror or error}") from None
    except yaml.MarkedYAMLError as error:
        place = f"{path}:{error.problem_mark.line + 1}" if error.problem_mark else f"{path}"
        raise ConfigError(f"{place}: not YAML: {error.problem or error.context}") from None
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise ConfigError(f"{path}: not YAML: {' '.join(str(error).split()):.200}") from None
    goals, mistakes = _read_list(root, spread)
    if mistakes:
        raise ConfigError("\n".join(f"{path}:{line}: {text}" for line, text in sorted(mistakes)))
    return goals


def _read_list(root: "yaml.Node | None", spread: bool) -> tuple[list[FileGoal], list[_Mistake]]:
    import yaml

    if not isinstance(root, yaml.SequenceNode) or not root.value:
        line = 1 if root is None else _line(root)
        return [], [_Mistake(line, "a list of goals is expected, such as - {robot: 1, x: 3.0, y: 4.0, yaw: 1.57}")]
    goals: list[FileGoal] = []
    mistakes: list[_Mistake] = []
    for node in root.value:
        found = list(_mistakes_of(node, spread))
        mistakes += found
        if not found:
            goals.append(_goal(node))
    return goals, mistakes


def _line(node: "yaml.Node") -> int:
    return int(node.start_mark.line) + 1


def _mistakes_of(node: "yaml.Node", spread: bool) -> Iterator[_Mistake]:
    import yaml

    if not isinstance(node, yaml.MappingNode):
        yield _Mistake(_line(node), "a goal is expected, such as {robot: 1, x: 3.0, y: 4.0, yaw: 1.57}")
        return
    seen = set()
    for key, value in node.value:
        name = str(key.value)
        if name not in _KEYS:
            known = ", ".join(_KEYS)
            yield _Mistake(_line(key), f"unknown key {name!r}{did_you_mean(name, _KEYS)}; known: {known}")
        elif name in seen:
            yield _Mistake(_line(key), f"{name} is given twice")
        else:
            seen.add(name)
            try:
                _value(name, value)
            except UsageError as error:
                yield _Mistake(_line(value), f"{name}: {error}")
    needed = _KEYS[1:3] if spread else _KEYS[:3]
    for name in needed:
        if name not in seen:
            hint = ", or name the robots that share the goals: --spread 0-3" if name == "robot" else ""
            yield _Mistake(_line(node), f"the key {name} is missing{hint}")


def _goal(node: "yaml.MappingNode") -> FileGoal:
    found = {key.value: _value(key.value, value) for key, value in node.value}
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


def robots_of(goals: Sequence[FileGoal]) -> list[int]:
    """The robots that the goals name, sorted."""
    return sorted({goal.robot for goal in goals if goal.robot is not None})
