"""The planned tours: what they promise, and that they can be planned anew."""

from pathlib import Path

import numpy as np
import pytest

from studies.chains.tours import LEAD_IN, Tour, planning, tours_of
from support.small_worlds import make_maze
from zteam.config.resources import shipped_world
from zteam.errors import UsageError
from zteam.simulator.core.occupancy_grid import map_message
from zteam.world import load_world


@pytest.mark.parametrize("world", ["office", "willow"])
def test_there_are_thirty_tours_of_the_right_length(world: str) -> None:
    """The leader drives 25 to 60 m on each, with room for 16 robots behind it."""
    name, tours = tours_of(world)
    lengths = [tour.length - LEAD_IN for tour in tours]
    assert name == world and len(tours) == 30
    assert min(lengths) > 23.0 and max(lengths) < 61.0


def test_tours_of_the_office_keep_clear_of_its_walls() -> None:
    """Every point of every tour has 0.3 m around it: an erratic's corner is 0.285 m from its base."""
    path = shipped_world("office")
    assert path is not None
    message = map_message(load_world(path), 0.1)
    occupied = message.data.reshape(message.info.height, message.info.width) > 0
    distance = planning.distance_to_walls(occupied)
    for tour in tours_of("office")[1]:
        cells = np.floor(np.array(tour.split(LEAD_IN)[1]) / 0.1).astype(int)
        assert distance[cells[:, 1], cells[:, 0]].min() >= 0.3


def test_a_world_without_tours_is_refused() -> None:
    """The error names the worlds that have some."""
    with pytest.raises(UsageError, match="office or willow"):
        tours_of("arena")


def test_a_tour_is_split_by_arc_length() -> None:
    """Both parts meet in the place, and nothing is lost."""
    tour = Tour(((0.0, 0.0), (2.0, 0.0), (2.0, 3.0)))
    assert tour.length == 5.0
    assert tour.split(3.0) == ([(0.0, 0.0), (2.0, 0.0), (2.0, 1.0)], [(2.0, 1.0), (2.0, 3.0)])
    assert tour.split(1.0) == ([(0.0, 0.0), (1.0, 0.0)], [(1.0, 0.0), (2.0, 0.0), (2.0, 3.0)])


def test_planning_is_repeatable(monkeypatch: pytest.MonkeyPatch) -> None:
    """The same world and seed give the same tours, each as long as was asked for and clear of walls."""
    monkeypatch.setattr(planning, "LEAD_IN", 1.0)
    monkeypatch.setattr(planning, "LENGTHS", (3.0, 4.0))
    monkeypatch.setattr(planning, "STRAIGHT", 0.2)
    monkeypatch.setattr(planning, "BENDS", 0.0)
    world = make_maze()
    first = planning.plan_tours(world, count=2)
    assert first == planning.plan_tours(world, count=2) and len(first) == 2
    assert all(3.0 < tour.length < 5.5 for tour in first)


def test_tours_lie_beside_the_code() -> None:
    """A wheel takes them along, because they are files of the package."""
    assert (Path(planning.__file__).parent / "office.json").is_file()
