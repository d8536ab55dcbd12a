"""Plain A* against the recorded optimal lengths of MovingAI's benchmarks (movingai.com, N. Sturtevant 2012)."""

import lzma
from pathlib import Path

import numpy as np
import pytest

from zteam.planning.search import Field, length_of

FOLDER = Path(__file__).resolve().parents[3] / "shared" / "planning" / "movingai"
MAPS = sorted(FOLDER.glob("*.map.xz"))
EVERY = 11
"""Of the lines of a scenario, which are sorted by length, each so many-th; `zteam bench nav --scenarios` does all."""


@pytest.mark.skipif(not MAPS, reason=f"{FOLDER} is not there: it holds MovingAI's maps, which are not zteam's own")
@pytest.mark.parametrize("path", MAPS, ids=lambda path: path.name)
def test_lengths_are_the_optimal_ones(path: Path) -> None:
    """To a ten-thousandth, on the first, the last and every eleventh line of a scenario."""
    lines = lzma.open(path, "rt").read().split("map\n", 1)[1].split()
    free = np.array([[cell in ".GS" for cell in line] for line in lines])
    field = Field(*free.shape)
    field.set_free(free)
    scenario = path.with_name(path.name.replace(".map.xz", ".map.scen.xz"))
    problems = [line.split("\t") for line in lzma.open(scenario, "rt").read().splitlines()[1:]]
    assert problems
    for problem in [*problems[::EVERY], problems[-1]]:
        x0, y0, x1, y1 = map(int, problem[4:8])
        way = field.find_way((y0, x0), (y1, x1))
        assert way is not None
        assert length_of(way) == pytest.approx(float(problem[8]), rel=1e-4), problem
