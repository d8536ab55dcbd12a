"""Plain A* on MovingAI's benchmarks (movingai.com, N. Sturtevant 2012): its lengths against the optimal ones."""

import lzma
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from studies.navigation.ways import length_of, plain_field
from zteam.errors import UsageError

_FREE = ".GS"
"""Terrain that can be entered from open ground."""
_TOLERANCE = 1e-4


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


def measure_scenarios(folder: Path) -> Iterator[tuple[str, float, str]]:
    """Of each scenario in a folder: name, share of its lines with the optimal length, and a remark."""
    paths = sorted([*folder.glob("*.scen"), *folder.glob("*.scen.xz")])
    if not paths:
        raise UsageError(f"{folder} has no scenarios (*.scen or *.scen.xz)")
    for path in paths:
        free = read_cells(path.with_name(path.name.replace(".scen", "")))
        field = plain_field(free)
        errors = []
        for start, goal, best in read_problems(path):
            way = field.find_way(start, goal)
            errors.append(abs(length_of(way) - best) / max(best, 1.0) if way is not None else np.inf)
        share = float(np.mean(np.array(errors) <= _TOLERANCE))
        yield path.name.partition(".")[0], share, f"{len(errors)} lines, largest difference {max(errors):.0e}"
