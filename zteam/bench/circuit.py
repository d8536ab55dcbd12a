"""A closed way through a world, on which a chain of robots drives round and round without meeting itself."""

from collections.abc import Iterator
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from zteam.behaviors.polyline import Polyline
from zteam.bench.chains.tours.planning import CELL, CLEARANCE, distance_to_walls, smooth, thin_out
from zteam.bench.navigation.scene import find_map, make_robot, outline_of
from zteam.counter_random import uniform
from zteam.errors import UsageError
from zteam.geometry import Pose2
from zteam.planning.costmap import CostmapOptions, make_costmap
from zteam.planning.grid import OCCUPIED
from zteam.planning.planner import AStarPlanner, NoPathError
from zteam.world import World

Floats = NDArray[np.float64]

APART = 1.2
"""Metres between two parts of a circuit, at least."""
_NEAR = 4.0
"""Metres along a circuit within which two places are in the same part."""
_SPARE = 8.0
"""Metres from the head of a chain to its last robot, which drives ahead of it, at least."""
_DRAWS = 400
_CHOICES = 3
"""Circuits that are found; the longest is taken."""
_STEP = 5
"""Of the points of a smooth way, 2 cm apart, each so-many-th is looked at."""


class Circuit:
    """A closed way; places on it are metres from its first waypoint, and go on round and round."""

    def __init__(self, waypoints: list[tuple[float, float]]) -> None:
        self.waypoints = waypoints
        """x and y in `map`, metres; the last is joined to the first."""
        self._way = Polyline([*waypoints, waypoints[0]])
        self.length = self._way.end

    def at(self, place: float) -> Pose2:
        """Where a place is, and the heading there."""
        return self._way.at(place % self.length)


def find_circuit(world: World, chain: float) -> Circuit:
    """A circuit for a chain of `chain` metres; it depends on the world alone. Raises UsageError without one."""
    ways = islice(filter(_is_apart, _closed_ways(world, chain + _SPARE)), _CHOICES)
    longest = max(ways, key=len, default=None)
    if longest is None:
        raise UsageError(f"world {world.name} has no way round of {chain + _SPARE:g} m for a line of so many robots")
    return Circuit([(round(float(x), 3), round(float(y), 3)) for x, y in thin_out(longest)[:-1]])


def _closed_ways(world: World, least: float) -> Iterator[Floats]:
    """Smooth ways (points, 2) that end where they begin, `least` metres long and more.

    One half is the shortest way between two places. The other one leads back while the first one is closed.
    """
    grid, outline = find_map(world, CELL), outline_of(make_robot(world, Pose2(0.0, 0.0, 0.0)))
    options = CostmapOptions(inflation_radius=0.8, cost_scaling_factor=4.0)
    costmap, planner = make_costmap(grid, outline, options), AStarPlanner()
    walls = distance_to_walls(grid.cells > 0)
    free = np.argwhere(walls > 2.0 * CLEARANCE)
    for draw in range(_DRAWS if len(free) else 0):
        cells = (free[int(uniform(1, draw, end) * len(free))].tolist() for end in (0, 1))
        start, end = (Pose2(*grid.frame.centre_of(*cell), 0.0) for cell in cells)
        try:
            there = planner.plan(costmap, start, end).path[:, :2]
            inner = there[round(_NEAR / 2 / CELL) : -round(_NEAR / 2 / CELL)]
            closed = grid.cells.copy()
            for x, y in inner.tolist():
                row, column = grid.frame.cell_at(x, y)
                reach = round(APART / CELL)
                closed[max(0, row - reach) : row + reach, max(0, column - reach) : column + reach] = OCCUPIED
            back = planner.plan(make_costmap(grid._replace(cells=closed), outline, options), end, start).path[:, :2]
        except NoPathError:
            continue
        # It is smoothed once round, and a half on: so its seam is smooth too.
        middle = len(there) // 2
        way = smooth(np.concatenate([there[middle:], back[1:], there[1 : middle + 1]]))
        rows, columns = grid.frame.points_to_cells(way).astype(int).T[::-1]
        if len(way) * 0.02 >= least and walls[rows, columns].min() >= CLEARANCE:
            yield way


def _is_apart(way: Floats) -> bool:
    """Whether no two parts of a closed way come near each other."""
    points = way[::_STEP]
    along = np.abs(np.subtract.outer(*2 * [np.arange(len(points)) * _STEP * 0.02]))
    length = len(way) * 0.02
    parts = np.minimum(along, length - along) > _NEAR
    return not (parts & (np.hypot(*(points[:, None] - points).T) < APART)).any()
