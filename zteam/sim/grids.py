"""Floor plans as what collides: which points and cells are occupied, and the border of them all."""

import math
from collections.abc import Iterable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from zteam.errors import UsageError
from zteam.kernels.binding import Bitmaps
from zteam.sim.fields import Fields, bitmap_of
from zteam.world.model import Floorplan

Lines = NDArray[np.intp]
"""(lines, 4): from x, y to x, y in cells."""
MAX_WALLS = 400_000
"""Straight pieces of wall of all bitmaps: noise has more, and Chipmunk takes a kilobyte and 20 us for each."""


def make_grids(floorplans: Sequence[tuple[Floorplan, Fields]]) -> Bitmaps:
    """The floor plans that are obstacles."""
    return Bitmaps([bitmap_of(plan, fields) for plan, fields in floorplans if plan.obstacle])


def is_occupied(plan: Floorplan, x: float, y: float) -> bool:
    """Whether the point (metres in `map`) lies in an occupied cell."""
    cos, sin = math.cos(plan.pose.yaw), math.sin(plan.pose.yaw)
    dx, dy = x - plan.pose.x, y - plan.pose.y
    column = math.floor((cos * dx + sin * dy) / plan.cell[0])
    row = math.floor((cos * dy - sin * dx) / plan.cell[1])
    rows, columns = plan.occupied.shape
    return 0 <= row < rows and 0 <= column < columns and bool(plan.occupied[row, column])


def find_walls(plans: Iterable[Floorplan]) -> Iterator[tuple[Floorplan, Lines]]:
    """Each plan and its border; plans of one bitmap share it. Raises UsageError if there are more than MAX_WALLS."""
    borders: dict[int, Lines | None] = {}
    left = MAX_WALLS
    for plan in plans:
        if id(plan.occupied) not in borders:
            borders[id(plan.occupied)] = find_borders(plan.occupied, MAX_WALLS)
        lines = borders[id(plan.occupied)]
        left -= 0 if lines is None else len(lines)
        if lines is None or left < 0:
            raise UsageError(
                f"with the bitmap of {plan.name!r} this world has more than {MAX_WALLS} straight pieces of wall: "
                "smooth it, or take the physics stage or kinematic"
            )
        yield plan, lines


def find_borders(occupied: NDArray[np.bool_], limit: int) -> Lines | None:
    """The border of the occupied cells as maximal straight runs; None if there are more than `limit`."""
    y, left, right = _runs(occupied)
    x, low, high = _runs(occupied.T)
    if len(x) + len(y) > limit:
        return None
    return np.concatenate([np.stack([x, low, x, high], axis=1), np.stack([left, y, right, y], axis=1)])


def _runs(occupied: NDArray[np.bool_]) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp]]:
    """Runs (line, begin, end) along axis 1 where occupied and free meet across axis 0."""
    rows, columns = occupied.shape
    padded = np.zeros((rows + 2, columns), bool)
    padded[1:-1] = occupied
    border = np.zeros((rows + 1, columns + 2), np.int8)
    border[:, 1:-1] = padded[1:] != padded[:-1]
    change = np.diff(border, axis=1)
    lines, begins = np.nonzero(change == 1)
    _, ends = np.nonzero(change == -1)
    return lines, begins, ends
