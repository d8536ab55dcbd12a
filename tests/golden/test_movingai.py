"""Plain A* against the recorded optimal lengths of MovingAI's benchmarks (movingai.com, N. Sturtevant 2012)."""

from pathlib import Path

import pytest

from studies.navigation.scenarios import read_cells, read_problems
from studies.navigation.ways import length_of, plain_field

FOLDER = Path(__file__).resolve().parents[3] / "shared" / "planning" / "movingai"
SCENARIOS = sorted(FOLDER.glob("*.scen.xz"))
EVERY = 31
"""Of the lines of a scenario, which are sorted by length, each so many-th."""


@pytest.mark.few(1)
@pytest.mark.skipif(not SCENARIOS, reason=f"{FOLDER} is not there: it holds MovingAI's maps, which are not zteam's own")
@pytest.mark.parametrize("path", SCENARIOS, ids=lambda path: path.name)
def test_lengths_are_the_optimal_ones(path: Path) -> None:
    """To a ten-thousandth, on the first, the last and every so many-th line of a scenario."""
    free = read_cells(path.with_name(path.name.replace(".scen", "")))
    field = plain_field(free)
    problems = read_problems(path)
    assert problems
    for start, goal, best in [*problems[::EVERY], problems[-1]]:
        way = field.find_way(start, goal)
        assert way is not None
        assert length_of(way) == pytest.approx(best, rel=1e-4), (start, goal)
