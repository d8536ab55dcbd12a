"""What stands for several keys or robots: [defaults], `ids`, `follow = "previous"`. All becomes one table a robot."""

import itertools
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from zteam.errors import UsageError, did_you_mean
from zteam.problems import Problem
from zteam.robot_ids import format_robot_ids, parse_robot_ids
from zteam.team_file.sources import Origins, Place, Tables, place_of

PREVIOUS = "previous"
"""`follow = "previous"`: the robot before this one in the file."""
GROUP_KEYS = ("ids", "pose_step")
"""Keys of a [[robots]] table besides those of RobotEntry."""
_OWN_KEYS = ("id", "ids", "pose", "pose_step")
"""Keys that every robot gives itself."""
_FAR = 1e9
"""Metres, and radians: no number of a pose is as large."""


class Expanded(NamedTuple):
    """Tables with one table a robot."""

    tables: Tables
    origins: Origins
    problems: list[Problem]
    ids_known: bool
    """Whether all ids could be read."""


def expand(tables: Tables, origins: Origins) -> Expanded:
    """The merged tables without groups and defaults. Repeated ids are reported; of a group they are left out."""
    expansion = _Expansion(tables, origins)
    robots = tables.get("robots")
    if not isinstance(robots, list):
        return Expanded(tables, origins, expansion.problems, ids_known=False)
    for i, table in enumerate(robots):
        expansion.add(i, table)
    tables = {**tables, "robots": expansion.robots}
    return Expanded(tables, expansion.origins, expansion.problems, expansion.ids_known)


class _Expansion:
    def __init__(self, tables: Tables, origins: Origins) -> None:
        self.robots: list[Any] = []
        self.problems: list[Problem] = []
        self.ids_known = True
        self._places = origins
        self.origins = {path: place for path, place in origins.items() if path[:1] != ("robots",) or len(path) == 1}
        self._previous: int | None = -1
        """The id of the robot before; -1 before the first, None where that id cannot be read."""
        self._seen: dict[int, Place] = {}
        self._defaults = self._read_defaults(tables.get("defaults", {}))

    def _read_defaults(self, value: Any) -> Mapping[str, Any]:
        if not isinstance(value, dict):
            self.problems.append(Problem(("defaults",), "a table is expected, as in [defaults]"))
            return {}
        for key in _OWN_KEYS:
            if key in value:
                self.problems.append(Problem(("defaults", key), "robots cannot share it; give it in [[robots]]"))
        return {key: item for key, item in value.items() if key not in _OWN_KEYS}

    def add(self, i: int, table: Any) -> None:
        """The table at index `i` of the merged file."""
        origin = place_of(self._places, ("robots", i))
        if not isinstance(table, dict):
            self._append(table, origin)
            return
        rest = {key: value for key, value in table.items() if key not in GROUP_KEYS}
        if "ids" not in table:
            if "pose_step" in table:
                self._tell(origin, "pose_step", "it belongs to ids: it leads from one pose to the next")
            self._add_robot(rest, origin, "id")
            return
        ids = self._read_ids(table, origin)
        repeated = [robot_id for robot_id in ids if robot_id in self._seen]
        if repeated:
            self._refuse(origin, "ids", repeated)
        poses = self._poses(table, origin)
        for robot_id in ids:
            pose = next(poses)
            if robot_id not in self._seen:
                self._add_robot({"id": robot_id, **rest, **pose}, origin, "ids")

    def _read_ids(self, table: Tables, origin: Place) -> tuple[int, ...]:
        value, told = table["ids"], ""
        if "id" in table:
            told = "both id and ids; keep one of them"
        elif isinstance(value, bool) or not isinstance(value, str | int):
            told = 'robot ids such as "1-7" are expected'
        else:
            try:
                return parse_robot_ids([str(value)], "ids")
            except UsageError as error:
                told = str(error).removeprefix("ids").removeprefix(":").strip()
        self.ids_known, self._previous = False, None
        self._tell(origin, "ids", told)
        return ()

    def _poses(self, table: Tables, origin: Place) -> Iterator[dict[str, Any]]:
        """The key `pose` of each of the ids, without end; empty where it is that of the table."""
        pose: Any = table.get("pose")
        step: Any = table.get("pose_step")
        if step is not None and not _are_numbers(step, 2):
            self._tell(origin, "pose_step", "[x, y] is expected: metres from one pose to the next")
        elif step is not None and "pose" not in table:
            self._tell(origin, "pose_step", "it needs the pose of the first of the ids")
        if not (_are_numbers(pose, 3) and _are_numbers(step, 2)):
            yield from itertools.repeat({})
        x, y, yaw = pose
        for number in itertools.count():
            # Rounded to the nanometre: 0.1 + 2 * 0.1 is 0.3.
            yield {"pose": [round(x + number * step[0], 9), round(y + number * step[1], 9), yaw]}

    def _add_robot(self, table: Tables, origin: Place, id_key: str) -> None:
        robot_id = _id_of(table)
        place = Place(origin.source, (*origin.path, id_key))
        if robot_id in self._seen:
            # Its other mistakes are told too.
            self._refuse(origin, id_key, [robot_id])
        defaults = {key: value for key, value in self._defaults.items() if _takes(table, key)}
        robot = {**defaults, **table}
        for key, value in defaults.items():
            if isinstance(value, dict) and isinstance(table.get(key), dict):
                robot[key] = {**value, **table[key]}
        self._resolve_leader(robot, origin)
        number = len(self.robots)
        self._append(robot, origin)
        self.origins["robots", number, "id"] = place
        for key in set(defaults).difference(table):
            self.origins["robots", number, key] = place_of(self._places, ("defaults", key))
        self._previous = robot_id if robot_id >= 0 else None
        if robot_id >= 0:
            self._seen.setdefault(robot_id, place)

    def _resolve_leader(self, robot: Tables, origin: Place) -> None:
        leader = robot.get("follow")
        if not isinstance(leader, str):
            return
        if leader != PREVIOUS:
            hint = did_you_mean(leader, [PREVIOUS])
            self._tell(origin, "follow", f'a robot id or "{PREVIOUS}" is expected, not {leader!r}{hint}')
        elif self._previous == -1:
            self._tell(origin, "follow", "there is no robot before the first one; let it lead")
        elif self._previous is not None:
            robot["follow"] = self._previous
            return
        del robot["follow"]

    def _append(self, table: Any, origin: Place) -> None:
        self.origins["robots", len(self.robots)] = origin
        self.robots.append(table)

    def _refuse(self, origin: Place, key: str, repeated: list[int]) -> None:
        first = self._seen[repeated[0]]
        where = "{}[{}]".format(*first.path)
        elsewhere = "" if first.source.number == origin.source.number else f" of {first}"
        what = f"robot {repeated[0]} is" if len(repeated) == 1 else f"robots {format_robot_ids(repeated)} are in"
        self._tell(origin, key, f"{what} {where}{elsewhere} already; give each robot its own id")

    def _tell(self, origin: Place, key: str, text: str) -> None:
        self.problems.append(Problem((origin.source.number, *origin.path, key), text))


def _id_of(table: Mapping[str, Any]) -> int:
    """The id of a robot; -1 for none."""
    value = table.get("id")
    return value if isinstance(value, int) and not isinstance(value, bool) else -1


def _takes(table: Mapping[str, Any], key: str) -> bool:
    """Whether a default of this key may hold for the robot."""
    if key in ("behavior", "follow"):
        # One of them replaces the other.
        return "behavior" not in table and "follow" not in table
    # A model belongs to the pose of a robot that the world lacks.
    return key != "model" or "pose" in table


def _are_numbers(value: Any, count: int) -> bool:
    if not isinstance(value, list | tuple) or len(value) != count:
        return False
    return all(isinstance(part, int | float) and not isinstance(part, bool) and abs(part) < _FAR for part in value)
