"""A bitmap prepared for exact ray casting: the largest empty square at every cell, for each quadrant of directions.

A ray that stands in a cell may leap to the edge of the empty square that opens into the ray's quadrant; nothing can
be hit before. The fields are stored mirrored, so that every ray runs towards larger columns and rows.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from zteam.kernels.binding import Bitmap, fill_squares
from zteam.world.model import Floorplan


class Fields(NamedTuple):
    """`sides[q]` is the flattened field of quadrant q = (dx < 0) + 2 (dy < 0); its last entry is a parking place."""

    sides: NDArray[np.uint8]
    rows: int
    columns: int


def build_fields(occupied: NDArray[np.bool_]) -> Fields:
    """Fields of a bitmap (rows, columns), row 0 at the bottom."""
    rows, columns = occupied.shape
    sides = np.zeros((4, rows * columns + 1), np.uint8)
    for quadrant in range(4):
        view = occupied[:, ::-1] if quadrant & 1 else occupied
        view = view[::-1] if quadrant & 2 else view
        fill_squares(np.ascontiguousarray(~view), sides[quadrant, :-1])
    return Fields(sides, rows, columns)


def bitmap_of(plan: Floorplan, fields: Fields) -> Bitmap:
    """A floor plan as kernels take it, with the fields of its bitmap."""
    return Bitmap(*fields, *plan.cell, *plan.pose, plan.z_min, plan.z_max)
