"""What a behaviour sees each step."""

from collections.abc import Callable, Mapping
from functools import cached_property
from types import MappingProxyType
from typing import Any, NamedTuple

import msgspec

from zteam import names
from zteam.base import DEFAULT_BASE, Base
from zteam.counter_random import uniform
from zteam.geometry import Pose2
from zteam.messages import LaserScan, Odometry

FindPose = Callable[[str, str], tuple[Pose2, int] | None]
"""`find_pose(target_frame, source_frame)`: the newest target_from_source and its stamp (ns; 0 where nothing between the
two frames moves), or None where the look-up failed."""
NO_BASES: Mapping[int, Base] = MappingProxyType({})


class Teammate(NamedTuple):
    """Another robot of the team."""

    robot_id: int
    pose: Pose2
    """In the own base frame."""
    age: float
    """Seconds since it was there."""
    base: Base


class View(msgspec.Struct, frozen=True, kw_only=True, eq=False, dict=True):
    """One robot's knowledge at `now`. Nothing in it changes while a behaviour looks at it."""

    now: int
    """Nanoseconds."""
    dt: float
    """Seconds since the last step; 0 on the first."""
    robot_id: int
    scan: LaserScan | None
    odom: Odometry | None
    lookup: FindPose
    base: Base = DEFAULT_BASE
    """Its outline and limits."""
    team: tuple[int, ...] = ()
    """Ids of the robots whose process is alive, as far as known; in lock-step those that take part in the tick."""
    inputs: Mapping[str, Any] = {}
    """What the behaviour declares in `inputs`, by name: the newest message or None; for a topic of every robot the
    newest messages by robot id."""
    seed: int = 1
    bases: Mapping[int, Base] = NO_BASES
    """The bases of the robots that have told theirs, by id."""

    @cached_property
    def teammates(self) -> tuple[Teammate, ...]:
        """All other robots of `team` and `bases` whose pose is known, by id; looked up when first asked for."""
        found = []
        for robot_id in sorted({*self.team, *self.bases} - {self.robot_id}):
            at = self.base_from_robot(robot_id)
            if at is not None:
                age = max(0.0, (self.now - at[1]) / 1e9) if at[1] else 0.0
                found.append(Teammate(robot_id, at[0], age, self.bases.get(robot_id, DEFAULT_BASE)))
        return tuple(found)

    @property
    def base_frame(self) -> str:
        """The robot's own base: x forward, y left."""
        return names.robot_frame(self.robot_id, names.BASE_FOOTPRINT)

    def map_from_base(self) -> tuple[Pose2, int] | None:
        """The robot's own pose in `map` and its stamp, or None."""
        # `cached_property` takes a lock: it would cost as much as the look-up.
        known = self.__dict__
        if "own_pose" not in known:
            known["own_pose"] = self.lookup(names.MAP_FRAME, self.base_frame)
        own_pose: tuple[Pose2, int] | None = known["own_pose"]
        return own_pose

    def base_from_robot(self, robot_id: int) -> tuple[Pose2, int] | None:
        """Another robot's pose in the own base frame and its stamp, or None."""
        return self.lookup(self.base_frame, names.robot_frame(robot_id, names.BASE_FOOTPRINT))

    def random(self, draw: int = 0) -> float:
        """A number in [0, 1): the same for the same seed, robot, time and `draw`, whatever else was drawn."""
        return uniform(self.seed, self.robot_id, self.now, draw)

    def is_fresh(self, stamp: int, max_age: float) -> bool:
        """Whether data of `stamp` is at most `max_age` seconds away from now: a stamp from the future counts as old."""
        return abs(self.now - stamp) <= max_age * 1e9
