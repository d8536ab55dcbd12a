"""Reads MovingAI's benchmarks (movingai.com, N. Sturtevant 2012): grids, and problems with their optimal lengths."""

import lzma
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from zteam.errors import UsageError

_FREE = ".GS"
"""Terrain that can be entered from open ground."""


def read_cells(path: Path) -> NDArray[np.bool_]:
    """Free cells (rows, columns) of a `.map` file, as it is or with `.xz`. Raises UsageError."""
    head, found, cells = _read(path).partition("map\n")
    lines = cells.split()
    if not found or "octile" not in head or not lines or len({len(line) for line in lines}) > 1:
        raise UsageError(f"{path} is no map of MovingAI")
    return np.array([[cell in _FREE for cell in line] for line in lines])


def read_problems(path: Path) -> list[tuple[tuple[int, int], tuple[int, int], float]]:
    """Start and goal (row, column) and optimal length of each line of a `.scen` file."""
    rows = [line.split("\t") for line in _read(path).splitlines()[1:] if line]
    return [((int(r[5]), int(r[4])), (int(r[7]), int(r[6])), float(r[8])) for r in rows]


def _read(path: Path) -> str:
    if path.suffix != ".xz":
        return path.read_text()
    with lzma.open(path, "rt") as file:
        return file.read()
