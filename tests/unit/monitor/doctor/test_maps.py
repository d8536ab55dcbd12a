"""Whether a map lies where the world is."""

import math

import msgspec
import pytest

from support.team_facts import WORLD_MAP, grid, nodes, problems, sim_status, team_facts
from zteam.monitor.doctor.maps import check_map, check_map_file, compare_with_world, find_differences
from zteam.simulator.client import MapInfo


def changed(**changes: float) -> MapInfo:
    """The grid of the world with a change."""
    return msgspec.structs.replace(WORLD_MAP, **changes)


def test_a_navigation_without_a_map_is_a_problem() -> None:
    """Whatever waits for the map is named, with the way out; without navigation a team needs none."""
    alive = nodes("monitor", "nav_1", "nav_2", "robot_1", "tf")
    facts = team_facts(nodes=alive, map=None, map_writer="", writers={}, sim=None)
    ((what, text, step),) = problems(check_map(facts))
    assert (what, step) == ("map", "zteam-map MAP.yaml")
    assert text == "nothing publishes 'map', without which nav_1, nav_2 cannot work"
    assert not list(check_map(team_facts(map=None, sim=None)))


def test_a_map_that_is_shifted_is_a_problem() -> None:
    """The text has the process that publishes it and the shift; the next step has the right origin."""
    facts = team_facts(map=grid(-2.0, -4.0), map_writer="map_server", writers={"map": ["map_server", "sim"]})
    ((what, text, step),) = problems(check_map(facts))
    assert what == "map"
    assert text == (
        "'map' of map_server (newer than that of sim) differs from the world arena: "
        "origin (-2, -4) instead of (-5, -4) m, shifted by +3.00 m in x and +0.00 m in y"
    )
    assert step == "the world's grid has origin [-5, -4, 0], resolution 0.05, 200 x 160 cells"


@pytest.mark.parametrize(
    "found",
    [
        WORLD_MAP,
        changed(resolution=0.05000000074505806),
        changed(x=-4.99),
        changed(resolution=0.1, columns=100, rows=80),
        changed(resolution=0.1, columns=101, rows=80),
        changed(yaw=6.283),
    ],
)
def test_a_map_of_the_same_area_is_good(found: MapInfo) -> None:
    """A finer or coarser map of the same place is the same; rounding does not count."""
    assert find_differences(found, WORLD_MAP) == []
    assert compare_with_world("'map'", found, WORLD_MAP, "arena").level == "ok"


@pytest.mark.parametrize(
    ("found", "level", "text"),
    [
        (changed(resolution=0.1), "problem", "resolution 0.1 instead of 0.05 m; size 20 x 16 instead of 10 x 8 m"),
        (changed(yaw=1.57), "problem", "turned by +1.570 rad"),
        (changed(y=-3.95, resolution=0.1, columns=100, rows=80), "ok", ""),
        (changed(y=-3.0, resolution=0.1, columns=100, rows=80), "problem", "+1.00 m in y"),
        (changed(x=-4.0, columns=100), "note", "size 5 x 8 instead of 10 x 8 m"),
        (changed(x=400.0, columns=100), "problem", "origin (400, -4)"),
        (changed(x=math.nan), "problem", "origin (nan, -4)"),
        (changed(yaw=math.nan), "problem", "turned by +nan rad"),
        (changed(resolution=math.nan), "problem", "resolution nan instead of 0.05 m"),
    ],
)
def test_what_differs_is_told(found: MapInfo, level: str, text: str) -> None:
    """A map with the world's cells or size must lie as the world does; another part of it may differ."""
    finding = compare_with_world("'map'", found, WORLD_MAP, "arena")
    assert finding.level == level
    assert text in finding.text


def test_a_map_in_another_frame_is_a_problem() -> None:
    """Its numbers mean something else."""
    other = grid(-5.0, -4.0)
    other.header.frame_id = "odom"
    ((_, text, step),) = problems(check_map(team_facts(map=other)))
    assert text == "'map' of sim is in the frame 'odom', not in 'map'"
    assert step == "let sim publish it in the frame 'map'"


def test_there_is_nothing_to_compare() -> None:
    """Without a simulator, or without a map, nothing is said."""
    assert not list(check_map(team_facts(sim=None)))
    assert not list(check_map(team_facts(map=None)))
    assert not list(check_map(team_facts(sim=sim_status(map=None))))


def test_a_map_file_is_compared_with_the_world() -> None:
    """The file's name is told; without a simulator the user is told to start one."""
    good = check_map_file("lab.yaml", WORLD_MAP, sim_status())
    assert (good.what, good.level) == ("map file", "ok")
    assert check_map_file("lab.yaml", changed(x=0.0), sim_status()).text.startswith("lab.yaml differs from the world")
    lonely = check_map_file("lab.yaml", WORLD_MAP, None)
    assert (lonely.good, lonely.next_step) == (False, "zteam-sim WORLD")


def test_a_map_beside_a_long_world_is_a_problem() -> None:
    """The circles round the two meet, the maps do not."""
    world, beside = MapInfo(0.0, 0.0, 0.0, 1.0, 100, 2), MapInfo(0.0, 50.0, 0.0, 1.0, 100, 1)
    assert compare_with_world("mine", beside, world, "long").level == "problem"
