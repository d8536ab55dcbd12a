"""The costmaps of one robot: a global one of the whole map to plan in, and a local one around the robot to drive in."""

import math
from collections.abc import Sequence
from typing import NamedTuple

from zteam.geometry import Pose2, Velocity
from zteam.messages.base import Base
from zteam.navigation.planning.costmap import Costmap, make_costmap
from zteam.navigation.planning.grid import GridGeometry, GridMap
from zteam.navigation.planning.parameters import Parameters
from zteam.navigation.planning.scans import Scan, Teammate

_FAR = 8.0
"""Metres: a teammate farther away will be elsewhere when the robot gets there, and each costs a part of a map anew."""


class Situation(NamedTuple):
    """What a robot sees in one step, and from where. Times are in seconds."""

    now: float
    seconds: float
    """To the next step."""
    pose: Pose2
    """Of the base, in `map`."""
    map_from_odom: Pose2
    scan: Scan | None = None
    teammates: Sequence[Teammate] = ()
    pending: Velocity = Velocity()
    """The command that moves the robot until the one of this step does."""


class Costmaps:
    def __init__(self, parameters: Parameters, base: Base, grid: GridMap) -> None:
        """Raises ValueError for parameters that do not fit this map or this base."""
        self._parameters, self._grid = parameters, grid
        self.whole = Costmap(grid.frame, parameters.global_window.outline(base), parameters.global_layers)
        """The global costmap."""
        self.whole.set_map(grid)
        window = parameters.local_window
        rows, columns = (max(1, round(size / window.resolution)) for size in (window.height, window.width))
        frame = GridGeometry(rows, columns, window.resolution)
        self.local = Costmap(frame, window.outline(base), parameters.local_layers)
        self._cell: tuple[int, int] | None = None
        """Row and column of the local costmap's origin in a grid of `odom`."""
        self._due_whole = self._due_local = -math.inf

    def of_map(self) -> Costmap:
        """What the map alone says, whatever lasers have seen: made anew, because it is large and seldom asked for."""
        return make_costmap(self._grid, self.whole.footprint, self._parameters.global_layers)

    def look(self, here: Situation) -> None:
        """Take in what the robot sees, where that is due."""
        if here.now >= self._due_local - 1e-6:
            self._due_local = here.now + 1.0 / self._parameters.local_window.update_frequency
            self.look_near(here)
        if here.now >= self._due_whole - 1e-6:
            self.look_far(here)

    def look_far(self, here: Situation) -> None:
        """Bring the global costmap up to date, unless this step has done so."""
        before, self._due_whole = self._due_whole, here.now + 1.0 / self._parameters.global_window.update_frequency
        if self._due_whole != before:
            _update(self.whole, here, _FAR)

    def look_near(self, here: Situation) -> None:
        """Bring the local costmap up to date: it moves with the robot."""
        frame = self.local.frame
        in_odom = here.map_from_odom.inverse().compose(here.pose)
        column = math.floor(in_odom.x / frame.resolution) - frame.columns // 2
        row = math.floor(in_odom.y / frame.resolution) - frame.rows // 2
        rows, columns = (0, 0) if self._cell is None else (row - self._cell[0], column - self._cell[1])
        self._cell = row, column
        # Cells stay where they are in `odom`: a correction of the localiser does not smear what lasers have seen.
        corner = Pose2(column * frame.resolution, row * frame.resolution, 0.0)
        origin = here.map_from_odom.compose(corner)
        self.local.move(GridGeometry(frame.rows, frame.columns, frame.resolution, origin), rows, columns)
        _update(self.local, here, frame.resolution * math.hypot(frame.rows, frame.columns))


def _update(costmap: Costmap, here: Situation, far: float) -> None:
    """Bring a costmap up to date, with the teammates up to `far` metres away."""
    x, y, _ = here.pose
    costmap.set_teammates(mate for mate in here.teammates if math.hypot(mate.x - x, mate.y - y) <= far)
    if here.scan is not None:
        costmap.observe(here.scan, here.pose, here.teammates)
    costmap.clear_footprint(here.pose)
    costmap.update()
