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


class Ways:
    """The cells in which robots have been."""

    def __init__(self) -> None:
        self._cells: dict[Cell, bool] = {}
        """Whether walls are on both sides there; the oldest first."""
        self._last: dict[int, Point2] = {}

    def note(self, places: Mapping[int, Point2]) -> None:
        """The robots are at these places (m, map) now.

        One that was set down there has the nearest of the others beside it, as in a team that is set down in a row.
        """
        came = {robot: at for robot, at in self._last.items() if robot in places and math.dist(at, places[robot]) < JUMP}
        for robot, before in came.items():
            self._join(before, places[robot])
        joined, rest = [places[robot] for robot in came], [at for robot, at in places.items() if robot not in came]
        while rest:
            at, other = min(((a, b) for a in rest for b in joined or rest[:1]), key=lambda pair: math.dist(*pair))
            self._join(other, at)
            rest.remove(at)
            joined.append(at)
        self._last = dict(places)

    def note_walls(self, place: Point2) -> None:
        """Walls are on both sides of this place."""
        self._cells[_cell_at(place)] = True

    def is_between_walls(self, place: Point2) -> bool:
        """Whether walls are on both sides there, or beside it, as was noted."""
        return any(self._cells.get(cell) for cell in _beside(_cell_at(place)))

    def row(self, first: int) -> dict[int, float]:
        """The other robots, and how many metres each one is from the end of their row over the ways.

        At the end, and the last one, is the robot that is furthest from `first`, which may be anywhere.
        """
        *_, end = self._distances(first)
        from_end = self._distances(end)
        return {robot: from_end[robot] for robot in reversed(from_end) if robot != first}

    def _distances(self, origin: int) -> dict[int, float]:
        """Metres from this robot to each one over the ways, itself first; infinite where none leads there."""
        here, metres = self._last[origin], 0.0
        front = [_cell_at(here)]
        found = dict.fromkeys(front, metres)
        while front:
            metres += CELL
            around = dict.fromkeys(cell for at in front for cell in _beside(at))
            front = [cell for cell in around if cell in self._cells and cell not in found]
            found.update(dict.fromkeys(front, metres))
        far = {robot: found.get(_cell_at(at), math.inf) for robot, at in self._last.items()}
        return dict(sorted(far.items(), key=lambda each: (each[1], math.dist(self._last[each[0]], here), each[0])))

    def _join(self, a: Point2, b: Point2) -> None:
        """A straight way from one place to another."""
        parts = max(1, math.ceil(2.0 * math.dist(a, b) / CELL))
        for part in range(parts + 1):
            share = part / parts
            cell = _cell_at((a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])))
            self._cells[cell] = self._cells.pop(cell, False)
        while len(self._cells) > MOST_CELLS:
            del self._cells[next(iter(self._cells))]


def _cell_at(place: Point2) -> Cell:
    return math.floor(place[0] / CELL), math.floor(place[1] / CELL)


def _beside(cell: Cell) -> list[Cell]:
    """The cell and the eight around it."""
    return [(cell[0] + dx, cell[1] + dy) for dx in (-1, 0, 1) for dy in (-1, 0, 1)]
