"""What a behaviour sees each step."""

from collections.abc import Callable

import msgspec

from zteam import names
from zteam.base import DEFAULT_BASE, Base
from zteam.counter_random import uniform
from zteam.geometry import Pose2
from zteam.messages import LaserScan, Odometry

FindPose = Callable[[str, str], tuple[Pose2, int] | None]
"""`find_pose(target_frame, source_frame)`: the newest target_from_source and its stamp (ns; 0 where nothing between the
two frames moves), or None where the look-up failed."""


class View(msgspec.Struct, frozen=True, kw_only=True, eq=False):
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
    """Ids of the robots that are alive, as far as known."""
    seed: int = 1

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
        """Whether data of `stamp` is at most `max_age` seconds away from now: a stamp from the future counts as old."""
        return abs(self.now - stamp) <= max_age * 1e9
