"""What one robot knows in a step: what its behaviour and its safety layer go by."""

import math
from collections.abc import Callable, Mapping, Set
from functools import cached_property
from typing import Any, NamedTuple

import msgspec

from zteam import names
from zteam.counter_random import uniform
from zteam.geometry import Point2, Pose2
from zteam.messages import LaserScan, Odometry
from zteam.messages.base import DEFAULT_BASE, Base

SILENT_AFTER = 2.0
"""Seconds without a status (they come at 1 Hz) after which a teammate is silent: simulated in lock-step, else the
host's."""
FindPose = Callable[[str, str], tuple[Pose2, int] | None]
"""`find_pose(target_frame, source_frame)`: the newest target_from_source and its stamp (ns; 0 where nothing between the
two frames moves), or None where the look-up failed."""


class Teammate(NamedTuple):
    """Another robot of the team."""

    robot_id: int
    pose: Pose2
    """In the own base frame."""
    age: float
    """Seconds between now and the stamp of its pose."""
    base: Base

    def along(self, heading: float) -> tuple[float, float]:
        """Metres to it along a heading (rad) from the own base, and to the left of that."""
        return Pose2(0.0, 0.0, heading).locate(self.pose.x, self.pose.y)


class View(msgspec.Struct, frozen=True, kw_only=True, eq=False, dict=True):
    """One robot's knowledge at `now`. Nothing in it changes while a behaviour looks at it."""

    now: int
    """Nanoseconds."""
    dt: float
    """Seconds since the last step; 0 on the first, and on the first after a pause."""
    robot_id: int
    scan: LaserScan | None
    """The newest, in the axes of the base however its laser is mounted: beams run from right to left, and angles count
    from the base's x axis. None before the first one, and if it cannot be used."""
    odom: Odometry | None
    lookup: FindPose
    laser: Point2 = (0.0, 0.0)
    """Where the beams of `scan` begin, in the base (m)."""
    scan_needs: str = ""
    """What is missing for the newest scan to be used, as a noun; empty if nothing is, or none has come."""
    base: Base = DEFAULT_BASE
    """Its outline and limits."""
    team: tuple[int, ...] = ()
    """Ids of the robots whose process is alive, as far as known; in lock-step those that take part in the tick."""
    inputs: Mapping[str, Any] = {}
    """What the behaviour declares in `inputs`, by name: the newest message or None; for a topic of every robot the
    newest messages by robot id."""
    silent: Set[int] = frozenset()
    """Robots whose newest status is more than SILENT_AFTER old: their process is frozen, cut off or gone. Known to
    behaviours that declare `robot_$*/status`."""
    seed: int = 1
    bases: Mapping[int, Base] = {}
    """The bases of the robots that have told theirs, by id."""

    @cached_property
    def teammates(self) -> tuple[Teammate, ...]:
        """All other robots of `team` and `bases` whose pose is known, by id; looked up when first asked for."""
        found = []
        for robot_id in sorted({*self.team, *self.bases} - {self.robot_id}):
            at = self.base_from_robot(robot_id)
            if at is not None:
                age = abs(self.now - at[1]) / 1e9 if at[1] else 0.0
                found.append(Teammate(robot_id, at[0], age, self.bases.get(robot_id, DEFAULT_BASE)))
        return tuple(found)

    @property
    def base_frame(self) -> str:
        """The robot's own base: x forward, y left."""
        return names.robot_frame(self.robot_id, names.BASE_FOOTPRINT)

    def map_from_base(self) -> tuple[Pose2, int] | None:
        """The robot's own pose in `map` and its stamp, or None."""
        return self.lookup(names.MAP_FRAME, self.base_frame)

    def base_from_robot(self, robot_id: int) -> tuple[Pose2, int] | None:
        """Another robot's pose in the own base frame and its stamp, or None."""
        return self.lookup(self.base_frame, names.robot_frame(robot_id, names.BASE_FOOTPRINT))

    def random(self, draw: int = 0) -> float:
        """A number in [0, 1): the same for the same seed, robot, time and `draw`, whatever else was drawn."""
        return uniform(self.seed, self.robot_id, self.now, draw)

    def is_fresh(self, stamp: int, max_age: float) -> bool:
        """Whether data of `stamp` is at most `max_age` seconds away from now: a stamp from the future is old, too."""
        return abs(self.now - stamp) <= max_age * 1e9


NO_POSE = f"its own pose in {names.MAP_FRAME} is not known"


def own_pose(view: View) -> Pose2 | None:
    """The robot's own pose in `map`; None where it is not known, or no number."""
    found = view.map_from_base()
    return found[0] if found is not None and math.isfinite(sum(found[0])) else None
