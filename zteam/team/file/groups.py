"""What stands for several keys or robots: [defaults], `ids`, `follow = "previous"`. All becomes one table a robot."""

import math
from collections.abc import Mapping
from typing import Any

import msgspec

from zteam.config.problems import KeyValueError, problems_of
from zteam.config.robot_ids import format_robot_ids, parse_robot_ids
from zteam.errors import UsageError
from zteam.geometry import Pose2
from zteam.team.file.entries import NO_BEHAVIOR, WITHOUT_PROCESS
from zteam.team.file.sources import KeyPlace, Mistake, Table, merge

PREVIOUS = "previous"
"""`follow = "previous"`: the robot before this one in the file."""
GROUP_KEYS = ("ids", "pose_step")
"""Keys of a [[robots]] table besides those of RobotEntry."""
_OWN_KEYS = ("id", "ids", "pose", "pose_step")
"""Keys that every robot gives itself."""


class _Group(msgspec.Struct):
    """The keys of a [[robots]] table that differ among its robots. Raises ValueError."""

    ids: str | int
    id: Any = None
    pose: Pose2 | None = None
    pose_step: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        if self.id is not None:
            raise KeyValueError("ids", "both id and ids; keep one of them")
        try:
            self.all_ids()
        except UsageError as error:
            raise KeyValueError("ids", str(error).strip(": ")) from None
        if self.pose_step and (self.pose is None or not all(map(math.isfinite, self.pose_step))):
            text = "[x, y] is expected, metres from one pose to the next; it needs the pose of the first of the ids"
            raise KeyValueError("pose_step", text)

    def all_ids(self) -> tuple[int, ...]:
        return parse_robot_ids([str(self.ids)], "")

    def keys_of(self, number: int) -> dict[str, Any]:
        """Keys of the robot of a `number`, instead of those of the table."""
        if self.pose is None or self.pose_step is None:
            return {}
        # Rounded to the nanometre: 0.1 + 2 * 0.1 is 0.3.
        x, y = (round(at + number * step, 9) for at, step in zip(self.pose, self.pose_step, strict=False))
        return {"pose": [x, y, self.pose.yaw]}


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
        found = team.get("defaults")
        self._defaults = found if isinstance(found, Table) else Table(team.place)
        for key in self._defaults.keys() & {*_OWN_KEYS}:
            place = team.place_of("defaults", key)
            self.mistakes.append(Mistake(place, "robots cannot share it; give it in [[robots]]"))
        for table in team["robots"]:
            self._add(table)

    def _add(self, table: Table) -> None:
        if "ids" not in table:
            if "pose_step" in table:
                self._tell(table, "pose_step", "it belongs to ids: it leads from one pose to the next")
            self._add_robot(table, "id", {})
            return
        keys = {key: table[key] for key in _OWN_KEYS if key in table}
        if problems := problems_of(keys, _Group):
            self.mistakes += table.locate(problems)
            self.ids_known, self._previous = False, None
            return
        group = msgspec.convert(keys, _Group)
        if repeated := [robot_id for robot_id in group.all_ids() if robot_id in self._seen]:
            self._refuse(table, "ids", repeated)
        for number, robot_id in enumerate(group.all_ids()):
            if robot_id not in self._seen:
                self._add_robot(table, "ids", {"id": robot_id, **group.keys_of(number)})

    def _add_robot(self, table: Table, id_key: str, own: dict[str, Any]) -> None:
        """Add a robot with the keys of its table, `own` ones and defaults; `id_key` says its id."""
        base, given = Table(table.place), Table(table.place)
        behavior = table.get("behavior", None if "follow" in table else self._defaults.get("behavior"))
        for key, value in self._defaults.items():
            if key not in _OWN_KEYS and _takes(table, key, behavior):
                base.put(key, value, self._defaults.place_of(key))
        given.update({key: value for key, value in table.items() if key not in GROUP_KEYS} | own)
        robot, place = merge(base, given, depth=1), table.place.below(id_key)
        if "id" in robot:
            robot.put("id", robot["id"], place)
        follow, wrong = robot.get("follow"), ""
        if follow == PREVIOUS:
            robot["follow"] = self._previous
            wrong = "there is no robot before the first one; let it lead" if self._previous == -1 else ""
        elif isinstance(follow, str):
            wrong = f'a robot id or "{PREVIOUS}" is expected'
        if wrong:
            self.mistakes.append(Mistake(robot.place_of("follow"), wrong))
            del robot["follow"]
        robot_id: Any = robot.get("id")
        # A truth value is an int too.
        is_known = type(robot_id) is int and robot_id >= 0
        self._previous = robot_id if is_known else None
        if is_known and self._seen.setdefault(robot_id, place) is not place:
            # Its other mistakes are told too.
            self._refuse(table, id_key, [robot_id])
        self.robots.append(robot)

    def _refuse(self, table: Table, key: str, repeated: list[int]) -> None:
        first = self._seen[repeated[0]]
        where = "{}[{}]".format(*first.path)
        elsewhere = "" if first.source is table.place.source else f" of {first}"
        what = f"robot {repeated[0]} is" if len(repeated) == 1 else f"robots {format_robot_ids(repeated)} are in"
        self._tell(table, key, f"{what} {where}{elsewhere} already; give each robot its own id")

    def _tell(self, table: Table, key: str, text: str) -> None:
        self.mistakes.append(Mistake(table.place.below(key), text))


def _takes(table: Mapping[str, Any], key: str, behavior: Any) -> bool:
    """Whether a default of this key may hold for the robot of a `behavior`."""
    if behavior == NO_BEHAVIOR and key not in WITHOUT_PROCESS:
        return False
    if key in ("behavior", "follow"):
        # One of them replaces the other.
        return "behavior" not in table and "follow" not in table
    # A model belongs to the pose of a robot that the world lacks.
    return key != "model" or "pose" in table
