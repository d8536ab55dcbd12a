"""Global planners: a costmap and two poses in, a path out. A* over weighted cells, then straight lines.

The lines cost no more than the way from cell to cell: first the cheapest way along lines of bounded length between its
cells, then its points move to the side where that is cheaper, both by dynamic programming.
"""

import math
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from zteam.config.numbers import NotNegative
from zteam.config.problems import CheckedOptions
from zteam.errors import ZteamError
from zteam.geometry import Pose2
from zteam.kernels import navigation as kernels
from zteam.kernels.binding import Cells, Floats
from zteam.kernels.navigation import UNREACHED, Steps
from zteam.navigation.planning.costmap import INSCRIBED_INFLATED_OBSTACLE, Costmap, Costs

COSTMAP_STEPS = (70, 99)
"""A diagonal step is √2 straight ones, less a hundredth of a percent; small, so that long ways fit into 32 bits."""

STRIDE, REACH = 4, 320
"""Lines join every fourth cell of a way from cell to cell, to those up to 320 cells before."""
NEUTRAL_COST, COST_FACTOR = 50, 0.8
"""Weight of a cell without costs, and what a cell's cost adds to it (NavFn's COST_NEUTRAL and COST_FACTOR)."""
_WEIGHT_OF_COST = int(COST_FACTOR * 256.0)
_DEAREST = NEUTRAL_COST + _WEIGHT_OF_COST * (INSCRIBED_INFLATED_OBSTACLE - 1) // 256
"""Weight of the dearest cell that can be entered."""
ESCAPE = 0.5
"""Metres that a path may lead out of cells that a robot should not be in, if the start is there."""
_SPACING = 20
"""Cells between the points that move to the side."""


class NoPathError(ZteamError):
    """There is no path; the text says why."""


class Plan(NamedTuple):
    """A path, and how good it is."""

    path: Floats
    """(n, 3): x, y in metres and yaw in radians, in the frame of the map. The first row is the start."""
    length: float
    """Metres."""
    short_of_goal: float
    """Metres from the end of the path to the goal that was asked for: 0 if the path reaches it."""


class Planner(Protocol):
    """What a planner must do; `zteam.navigation.planning.parameters` knows them by name."""

    def plan(self, costmap: Costmap, start: Pose2, goal: Pose2) -> Plan:
        """A path from `start` to `goal` (poses in the frame of the map). Raises NoPathError."""


class Field:
    """Weights of a grid's cells, and the memory of searches on it. Keep it: making it costs as much as a search."""

    def __init__(self, rows: int, columns: int) -> None:
        self.shape = rows, columns
        self.steps = Steps(*COSTMAP_STEPS, 1)
        self.weights = np.zeros((rows + 2, columns + 2), np.uint8)
        """Of the cells, with a border of 0; 0 cannot be entered."""
        self._costs = np.full((rows + 2, columns + 2), UNREACHED, np.uint32)

    def set_costs(self, costs: Costs, *, allow_unknown: bool, barred: int = INSCRIBED_INFLATED_OBSTACLE) -> None:
        """A costmap: a cell weighs NEUTRAL_COST + COST_FACTOR · its cost; those from the cost `barred` on cannot be
        entered. Unknown cells weigh as much as the dearest ones that can, or cannot be entered."""
        unknown = _DEAREST if allow_unknown else 0
        kernels.weigh_cells(costs, NEUTRAL_COST, _WEIGHT_OF_COST, barred, unknown, self.weights)
        self.steps = Steps(*COSTMAP_STEPS, NEUTRAL_COST)

    def is_free(self, row: int, column: int) -> bool:
        """Whether a cell can be entered; one outside cannot."""
        return self.holds(row, column) and bool(self.weights[row + 1, column + 1])

    def holds(self, row: int, column: int) -> bool:
        return 0 <= row < self.shape[0] and 0 <= column < self.shape[1]

    def nearest_free(self, cell: tuple[int, int], tolerance: float) -> tuple[int, int] | None:
        """The cell (row, column) nearest to this one that can be entered, up to `tolerance` cells from it."""
        found = self._nearest(self.weights, 0, cell, tolerance)
        return None if found is None else (found // (self.shape[1] + 2) - 1, found % (self.shape[1] + 2) - 1)

    def find_way(self, start: tuple[int, int], goal: tuple[int, int], tolerance: float = 0.0) -> Cells | None:
        """The cheapest way between two cells (row, column): (n, 2) as (column, row), each beside the one before.

        If there is none, the way to the cell nearest to the goal that can be reached, up to `tolerance` cells from it.
        None if there is no way at all. Raises ValueError for a start that cannot be entered.
        """
        if not self.is_free(*start):
            raise ValueError(f"the start, row {start[0]}, column {start[1]}, cannot be entered")
        stride = self.shape[1] + 2
        begin = (start[0] + 1) * stride + start[1] + 1
        end = self._nearest(self.weights, 0, goal, tolerance)
        if end is None:
            return None
        found, (low, high, left, right) = kernels.search(self.weights, begin, end, self.steps, self._costs)
        if not found:
            # All that can be reached has been.
            end = self._nearest(self._costs, UNREACHED, goal, tolerance)
        cells = None if end is None else kernels.trace(self.weights, begin, end, self.steps, self._costs)
        self._costs[low : high + 1, left : right + 1] = UNREACHED
        if cells is None:
            return None
        y, x = np.divmod(cells[::-1], stride)
        return np.stack((x - 1, y - 1), axis=1)

    def _nearest(self, cells: NDArray[Any], nothing: int, goal: tuple[int, int], tolerance: float) -> int | None:
        """The index of the cell other than `nothing` that is nearest to the goal, up to `tolerance` cells from it."""
        if self.holds(*goal) and cells[goal[0] + 1, goal[1] + 1] != nothing:
            return int((goal[0] + 1) * cells.shape[1] + goal[1] + 1)
        reach = int(tolerance)
        low, left = max(0, goal[0] + 1 - reach), max(0, goal[1] + 1 - reach)
        part = cells[low : max(0, goal[0] + 2 + reach), left : max(0, goal[1] + 2 + reach)]
        found = np.argwhere(part != nothing) + np.array((low, left))
        away = ((found - np.array(goal) - 1) ** 2).sum(axis=1)
        if not len(found) or away.min() > tolerance * tolerance:
            return None
        row, column = found[away.argmin()].tolist()
        return int(row * cells.shape[1] + column)

    def shorten(self, way: Cells) -> Cells:
        """The corners of a way of straight lines (n, 2) that costs no more than a way from cell to cell."""
        if len(way) < 3:
            return way
        return kernels.straighten(self.weights, way + 1, STRIDE, REACH, _SPACING, self.steps.least) - 1


class AStarOptions(CheckedOptions, frozen=True):
    """Parameters; names that Nav2's planners have are theirs."""

    tolerance: NotNegative = 0.5
    """Metres from the goal at which a path may end, if the goal itself cannot be reached (NavfnPlanner)."""
    allow_unknown: bool = True
    """Whether a path may lead through cells without information (NavfnPlanner)."""
    clearance: NotNegative | None = None
    """Metres from the middle of the robot to obstacles on a path; None: half of its width, and half a cell. It is at
    least the inscribed radius, and at most the costmap's inflation radius."""


class AStarPlanner:
    """A* over the cells of a costmap, then straight lines that cost no more."""

    def __init__(self, options: AStarOptions | None = None) -> None:
        self.options = options or AStarOptions()
        self._field: Field | None = None

    def plan(self, costmap: Costmap, start: Pose2, goal: Pose2) -> Plan:
        """A path from `start` to `goal`, or to the nearest point up to `tolerance` from it. Raises NoPathError."""
        frame, options = costmap.frame, self.options
        for what, pose in (("start", start), ("goal", goal)):
            is_finite = all(map(math.isfinite, pose))
            if not is_finite or not frame.holds(*frame.cell_at(pose.x, pose.y)):
                problem = "outside of the map" if is_finite else "not finite"
                raise NoPathError(f"the {what} ({pose.x:.2f}, {pose.y:.2f}) is {problem}")
        field = self.prepare(costmap)
        # The cell of the start, or the nearest one that a robot may be in.
        first = field.nearest_free(frame.cell_at(start.x, start.y), ESCAPE / frame.resolution)
        if first is None:
            where = f"({start.x:.2f}, {start.y:.2f}) is in an obstacle, and nothing within {ESCAPE:g} m is free"
            raise NoPathError(f"the start {where}: drive the robot away from it, or clear the costmap")
        last = frame.cell_at(goal.x, goal.y)
        way = field.find_way(first, last, options.tolerance / frame.resolution)
        if way is None:
            where, near = f"the goal ({goal.x:.2f}, {goal.y:.2f})", f"within {options.tolerance:g} m of it"
            if field.is_free(*last):
                raise NoPathError(f"no way leads to {where}, nor to {near}")
            raise NoPathError(f"{where} is in an obstacle or too close to one, and so is all {near}")
        reached = (int(way[-1, 1]), int(way[-1, 0])) == last
        points = frame.points_from_cells(field.shorten(way).astype(np.float64) + 0.5)
        # The middle of the first cell is left out where the start lies in that cell.
        on = points[1:] if first == frame.cell_at(start.x, start.y) else points
        points = np.concatenate(([[start.x, start.y]], on))
        if reached:
            points = np.concatenate((points[:-1] if len(points) > 1 else points, [[goal.x, goal.y]]))
        missing = 0.0 if reached else math.dist(points[-1], (goal.x, goal.y))
        path = kernels.lay_path(points, goal.yaw, frame.resolution)
        return Plan(path, float(np.hypot(*np.diff(points, axis=0).T).sum()), missing)

    def prepare(self, costmap: Costmap) -> Field:
        """The weights of a costmap's cells, for a search."""
        shape = costmap.costs.shape
        if self._field is None or self._field.shape != shape:
            self._field = Field(*shape)
        clearance = self.options.clearance
        if clearance is None:
            clearance = costmap.footprint.half_width + 0.5 * costmap.frame.resolution
        # From here on cells are too near to an obstacle for a robot that drives along its path.
        barred = min(INSCRIBED_INFLATED_OBSTACLE, max(1, costmap.cost_of_distance(clearance)))
        self._field.set_costs(costmap.costs, allow_unknown=self.options.allow_unknown, barred=barred)
        return self._field
