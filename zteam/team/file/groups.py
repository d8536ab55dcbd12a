"""What stands for several keys or robots: [defaults], `ids`, `follow = "previous"`. All becomes one table a robot."""

import itertools
from collections.abc import Iterator, Mapping
from typing import Any

from zteam.config.robot_ids import format_robot_ids, parse_robot_ids
from zteam.errors import UsageError, did_you_mean
from zteam.team.file.sources import KeyPlace, Mistake, Table, merge

PREVIOUS = "previous"
"""`follow = "previous"`: the robot before this one in the file."""
GROUP_KEYS = ("ids", "pose_step")
"""Keys of a [[robots]] table besides those of RobotEntry."""
_OWN_KEYS = ("id", "ids", "pose", "pose_step")
"""Keys that every robot gives itself."""
_FAR = 1e9
"""Metres, and radians: no number of a pose is as large."""


class Expansion:
    """The robots of a merged team file, one table each. Repeated ids are told; of a group they are left out."""

    def __init__(self, team: Table) -> None:
        self.robots: list[Table] = []
        self.mistakes: list[Mistake] = []
        self.ids_known = True
        """Whether all ids could be read."""
        self._previous: int | None = -1
        """The id of the robot before; -1 before the first, None where that id cannot be read."""
        self._seen: dict[int, KeyPlace] = {}
        self._defaults = self._read_defaults(team)
        for table in team["robots"]:
            self._add(table)

    def _read_defaults(self, team: Table) -> Table:
        defaults = Table(team.place_of("defaults"))
        value = team.get("defaults", {})
        if not isinstance(value, dict):
            self.mistakes.append(Mistake(defaults.place, "a table is expected, as in [defaults]"))
            return defaults
        for key, item in value.items():
            place = team.place_of("defaults", key)
            if key in _OWN_KEYS:
                self.mistakes.append(Mistake(place, "robots cannot share it; give it in [[robots]]"))
            else:
                defaults.put(key, item, place)
        return defaults

    def _add(self, table: Table) -> None:
        """Add the robots of a [[robots]] table."""
        if "ids" not in table:
            if "pose_step" in table:
                self._tell(table, "pose_step", "it belongs to ids: it leads from one pose to the next")
            self._add_robot(table, "id", {})
            return
        ids = self._read_ids(table)
        repeated = [robot_id for robot_id in ids if robot_id in self._seen]
        if repeated:
            self._refuse(table, "ids", repeated)
        poses = self._poses(table)
        for robot_id in ids:
            pose = next(poses)
            if robot_id not in self._seen:
                self._add_robot(table, "ids", {"id": robot_id, **pose})

    def _read_ids(self, table: Table) -> tuple[int, ...]:
        value, told = table["ids"], ""
        if "id" in table:
            told = "both id and ids; keep one of them"
        elif isinstance(value, bool) or not isinstance(value, str | int):
            told = 'robot ids such as "1-7" are expected'
        else:
            try:
                return parse_robot_ids([str(value)], "")
            except UsageError as error:
                told = str(error).strip(": ")
        self.ids_known, self._previous = False, None
        self._tell(table, "ids", told)
        return ()

    def _poses(self, table: Table) -> Iterator[dict[str, Any]]:
        """The key `pose` of each of the ids, without end; empty where it is that of the table."""
        pose, step = table.get("pose"), table.get("pose_step")
        if step is not None and not _are_numbers(step, 2):
            self._tell(table, "pose_step", "[x, y] is expected: metres from one pose to the next")
        elif step is not None and pose is None:
            self._tell(table, "pose_step", "it needs the pose of the first of the ids")
        if not (_are_numbers(pose, 3) and _are_numbers(step, 2)):
            yield from itertools.repeat({})
        assert isinstance(pose, list) and isinstance(step, list)
        x, y, yaw = pose
        for number in itertools.count():
            # Rounded to the nanometre: 0.1 + 2 * 0.1 is 0.3.
            yield {"pose": [round(x + number * step[0], 9), round(y + number * step[1], 9), yaw]}

    def _add_robot(self, table: Table, id_key: str, own: dict[str, Any]) -> None:
        """Add a robot with the keys of its table, `own` ones and defaults; `id_key` says its id."""
        base, given = Table(table.place), Table(table.place)
        for key, value in self._defaults.items():
            if _takes(table, key):
                base.put(key, value, self._defaults.place_of(key))
        given.update({key: value for key, value in table.items() if key not in GROUP_KEYS} | own)
        robot = merge(base, given, depth=1)
        place = table.place.below(id_key)
        robot_id = _id_of(robot)
        if robot_id in self._seen:
            # Its other mistakes are told too.
            self._refuse(table, id_key, [robot_id])
        self._resolve_leader(robot, table)
        if "id" in robot:
            robot.put("id", robot["id"], place)
        self.robots.append(robot)
        self._previous = robot_id if robot_id >= 0 else None
        if robot_id >= 0:
            self._seen.setdefault(robot_id, place)

    def _resolve_leader(self, robot: Table, table: Table) -> None:
        leader = robot.get("follow")
        if not isinstance(leader, str):
            return
        if leader != PREVIOUS:
            hint = did_you_mean(leader, [PREVIOUS])
            self._tell(table, "follow", f'a robot id or "{PREVIOUS}" is expected, not {leader!r}{hint}')
        elif self._previous == -1:
            self._tell(table, "follow", "there is no robot before the first one; let it lead")
        elif self._previous is not None:
            robot["follow"] = self._previous
            return
        del robot["follow"]

    def _refuse(self, table: Table, key: str, repeated: list[int]) -> None:
        first = self._seen[repeated[0]]
        where = "{}[{}]".format(*first.path)
        elsewhere = "" if first.source is table.place.source else f" of {first}"
        what = f"robot {repeated[0]} is" if len(repeated) == 1 else f"robots {format_robot_ids(repeated)} are in"
        self._tell(table, key, f"{what} {where}{elsewhere} already; give each robot its own id")

    def _tell(self, table: Table, key: str, text: str) -> None:
        self.mistakes.append(Mistake(table.place.below(key), text))


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
