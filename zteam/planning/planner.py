"""Global planners: a costmap and two poses in, a path out."""

import math
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from zteam.errors import ZteamError
from zteam.geometry import Pose2
from zteam.planning.costmap import Costmap
from zteam.planning.costs import INSCRIBED_INFLATED_OBSTACLE
from zteam.planning.grid import Frame
from zteam.planning.search import Field

Floats = NDArray[np.float64]


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
    """What a planner must do; `zteam.planning.plugins` knows them by name."""

    def plan(self, costmap: Costmap, start: Pose2, goal: Pose2) -> Plan:
        """A path from `start` to `goal` (poses in the frame of the map). Raises NoPathError."""
        ...


class AStarOptions(NamedTuple):
    """Parameters; names that Nav2's planners have are theirs."""

    tolerance: float = 0.5
    """Metres from the goal at which a path may end, if the goal itself cannot be reached (NavfnPlanner)."""
    allow_unknown: bool = True
    """Whether a path may lead through cells without information (NavfnPlanner)."""
    neutral_cost: int = 50
    """Weight of a cell without costs (NavFn's COST_NEUTRAL)."""
    cost_factor: float = 0.8
    """What a cell's cost adds to its weight (NavFn's COST_FACTOR)."""
    any_angle: bool = True
    """Whether the path is made of straight lines in any direction, or of steps from cell to cell."""
    clearance: float | None = None
    """Metres from the middle of the robot to obstacles on a path; None: half of its width, and half a cell. It is at
    least the inscribed radius, and at most the costmap's inflation radius."""
    escape: float = 0.5
    """Metres that a path may lead out of cells that a robot should not be in, if the start is there."""


class AStarPlanner:
    """A* over the cells of a costmap, then straight lines that cost no more."""

    def __init__(self, options: AStarOptions | None = None) -> None:
        """Raises ValueError for weights that do not fit."""
        self.options = options or AStarOptions()
        self._field: Field | None = None

    def plan(self, costmap: Costmap, start: Pose2, goal: Pose2) -> Plan:
        """A path from `start` to `goal`, or to the nearest point up to `tolerance` from it. Raises NoPathError."""
        frame, options = costmap.frame, self.options
        for what, pose in (("start", start), ("goal", goal)):
            _check_pose(frame, what, pose)
        field = self.prepare(costmap)
        first = self._leave(field, frame, start)
        last = frame.cell_at(goal.x, goal.y)
        way = field.find_way(first, last, options.tolerance / frame.resolution)
        if way is None:
            raise NoPathError(_reason(costmap, field, last, options.tolerance))
        reached = (int(way[-1, 1]), int(way[-1, 0])) == last
        corners = field.shorten(way) if options.any_angle else way
        points = frame.points_from_cells(corners.astype(np.float64) + 0.5)
        points = np.concatenate(([[start.x, start.y]], points[1:] if first == _cell(frame, start) else points))
        if reached:
            points = np.concatenate((points[:-1] if len(points) > 1 else points, [[goal.x, goal.y]]))
        missing = 0.0 if reached else math.dist(points[-1], (goal.x, goal.y))
        path = make_path(points, goal.yaw, frame.resolution)
        return Plan(path, float(np.hypot(*np.diff(points, axis=0).T).sum()), missing)

    def prepare(self, costmap: Costmap) -> Field:
        """The weights of a costmap's cells, for a search."""
        shape = costmap.costs.shape
        if self._field is None or self._field.shape != shape:
            self._field = Field(*shape)
        options = self.options
        barred = self._find_barred(costmap)
        self._field.set_costs(costmap.costs, options.neutral_cost, options.cost_factor, options.allow_unknown, barred)
        return self._field

    def _find_barred(self, costmap: Costmap) -> int:
        """The least cost of cells that are too near to an obstacle for a robot that drives along its path."""
        clearance = self.options.clearance
        if clearance is None:
            clearance = costmap.footprint.half_width + 0.5 * costmap.frame.resolution
        return min(INSCRIBED_INFLATED_OBSTACLE, max(1, costmap.cost_of_distance(clearance)))

    def _leave(self, field: Field, frame: Frame, start: Pose2) -> tuple[int, int]:
        """The cell of the start, or the nearest one up to `escape` from it that a robot may be in."""
        cell = _cell(frame, start)
        found = field.nearest_free(cell, self.options.escape / frame.resolution)
        if found is None:
            raise NoPathError(
                f"the start ({start.x:.2f}, {start.y:.2f}) is in an obstacle, and nothing within "
                f"{self.options.escape:g} m is free: drive the robot away from it, or clear the costmap"
            )
        return found


def _cell(frame: Frame, pose: Pose2) -> tuple[int, int]:
    return frame.cell_at(pose.x, pose.y)


def _check_pose(frame: Frame, what: str, pose: Pose2) -> None:
    if not all(map(math.isfinite, pose)):
        raise NoPathError(f"the {what} is not finite: {tuple(pose)}")
    if not frame.holds(*frame.cell_at(pose.x, pose.y)):
        raise NoPathError(f"the {what} ({pose.x:.2f}, {pose.y:.2f}) is outside of the map")


def _reason(costmap: Costmap, field: Field, goal: tuple[int, int], tolerance: float) -> str:
    x, y = costmap.frame.centre_of(*goal)
    where = f"({x:.2f}, {y:.2f})"
    if not field.is_free(*goal):
        return f"the goal {where} is in an obstacle or too close to one, and so is all within {tolerance:g} m of it"
    return f"no way leads to the goal {where}, nor to within {tolerance:g} m of it"


def make_path(points: Floats, yaw: float, spacing: float) -> Floats:
    """Poses (n, 3) along the lines between points (n, 2), at most `spacing` metres apart; the last one has `yaw`.

    All others face the next one.
    """
    points = np.asarray(points, np.float64)
    points = points[np.concatenate(([True], (np.abs(np.diff(points, axis=0)) > 1e-9).any(axis=1)))]
    delta = np.diff(points, axis=0)
    lengths = np.hypot(delta[:, 0], delta[:, 1])
    counts = np.maximum(1, np.ceil(lengths / spacing)).astype(np.int64)
    line = np.repeat(np.arange(len(counts)), counts)
    share = (np.arange(len(line)) - np.repeat(np.cumsum(counts) - counts, counts)) / np.repeat(counts, counts)
    path = np.empty((len(line) + 1, 3))
    path[:-1, :2] = points[line] + share[:, None] * delta[line]
    path[:-1, 2] = np.arctan2(delta[line, 1], delta[line, 0])
    path[-1] = points[-1, 0], points[-1, 1], yaw
    return path
