"""Bitmaps as Stage reads them: their occupied cells, the box around these, and rectangles that cover them."""

from pathlib import Path

import numpy as np

from zteam.config.map_files import Grid, read_channels

DARK = 127
"""A pixel is occupied if its first channel is not above this: Stage's fixed threshold; map_server's 205 is free."""

Box = tuple[int, int, int, int]


def read_bitmap(path: Path) -> Grid:
    """Occupied cells of an image, (rows, columns) with row 0 at the bottom; alpha does not count.

    Raises WorldError, as `read_channels` does.
    """
    return np.ascontiguousarray(read_channels(path)[::-1, :, 0] <= DARK)


def occupied_box(occupied: Grid) -> Box | None:
    """Smallest box around the occupied cells, half open: (first row, end row, first column, end column)."""
    rows = np.flatnonzero(occupied.any(axis=1))
    if rows.size == 0:
        return None
    columns = np.flatnonzero(occupied.any(axis=0))
    return int(rows[0]), int(rows[-1]) + 1, int(columns[0]), int(columns[-1]) + 1


def rectangles(occupied: Grid, limit: int) -> list[Box] | None:
    """Disjoint boxes that cover the occupied cells: each row's runs, joined with equal runs of the rows above.

    None if there are more than `limit`.
    """
    steps = np.diff(occupied, axis=1, prepend=False, append=False)
    rows, columns = np.nonzero(steps)
    if rows.size > 2 * limit * len(occupied):
        return None
    runs_of: list[set[tuple[int, int]]] = [set() for _ in range(len(occupied) + 1)]
    for row, start, end in zip(rows[::2].tolist(), columns[::2].tolist(), columns[1::2].tolist(), strict=True):
        runs_of[row].add((start, end))
    done: list[Box] = []
    growing: dict[tuple[int, int], int] = {}
    for row, runs in enumerate(runs_of):
        done.extend((growing.pop(run), row, *run) for run in growing.keys() - runs)
        growing.update(dict.fromkeys(runs - growing.keys(), row))
        if len(done) > limit:
            return None
    return sorted(done)
