"""Where the robots of a team have been: how far it is from one of them to another where walls are between."""

import math
from collections.abc import Mapping

from zteam.geometry import Point2

CELL = 0.2
"""Metres: side of a cell. The ways on both sides of a wall are not in cells beside each other: bases are wider."""
JUMP = 1.0
"""Metres between two looks after which a robot was set down elsewhere."""
MOST_CELLS = 2000
"""The newest ones are kept."""

Cell = tuple[int, int]


def cell_at(place: Point2) -> Cell:
    """The cell of a place (m, map)."""
    return math.floor(place[0] / CELL), math.floor(place[1] / CELL)


def beside(cell: Cell) -> list[Cell]:
    """The cell and the eight around it."""
    return [(cell[0] + dx, cell[1] + dy) for dx in (-1, 0, 1) for dy in (-1, 0, 1)]


class Ways:
    """The cells in which robots have been."""

    def __init__(self) -> None:
        self._cells: dict[Cell, bool] = {}
        """Whether walls are on both sides there; the oldest first."""
        self._last: dict[int, Point2] = {}

    def note(self, places: Mapping[int, Point2]) -> None:
        """The robots are at these places (m, map) now.

        One that was not seen before stands as the team was set down: the way to it leads from the nearest of the
        others, until there are other ones.
        """
        known = {robot: at for robot, at in places.items() if math.dist(self._last.get(robot, (math.inf,) * 2), at) < JUMP}
        for robot, at in known.items():
            self._join(self._last[robot], at)
        new = places.keys() - known.keys()
        while new:
            origins = known or {robot: places[robot] for robot in sorted(new)[:1]}
            _, robot, origin = min((math.dist(places[robot], origins[other]), robot, other) for robot in new for other in origins)
            self._join(origins[origin], places[robot])
            known[robot] = places[robot]
            new.remove(robot)
        self._last = dict(places)

    def _join(self, a: Point2, b: Point2) -> None:
        parts = max(1, math.ceil(2.0 * math.dist(a, b) / CELL))
        for part in range(parts + 1):
            share = part / parts
            cell = cell_at((a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])))
            self._cells[cell] = self._cells.pop(cell, False)
        while len(self._cells) > MOST_CELLS:
            del self._cells[next(iter(self._cells))]

    def note_walls(self, place: Point2) -> None:
        """Walls are on both sides of this place."""
        self._cells[cell_at(place)] = True

    def is_between_walls(self, place: Point2) -> bool:
        """Whether walls are on both sides there, as a robot has found."""
        return any(self._cells.get(cell) for cell in beside(cell_at(place)))

    def distances(self, first: int) -> dict[int, float]:
        """Metres from this robot to each of the others over the ways, the nearest first; infinite without one."""
        here, metres = self._last[first], 0.0
        front = [cell_at(here)]
        found = dict.fromkeys(front, metres)
        while front:
            metres += CELL
            around = dict.fromkeys(cell for at in front for cell in beside(at))
            front = [cell for cell in around if cell in self._cells and cell not in found]
            found.update(dict.fromkeys(front, metres))
        far = {robot: found.get(cell_at(at), math.inf) for robot, at in self._last.items() if robot != first}
        return dict(sorted(far.items(), key=lambda each: (each[1], math.dist(self._last[each[0]], here), each[0])))
