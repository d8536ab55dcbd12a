"""Narrow places: what a seed draws, and which robots are stuck in them."""

from pathlib import Path

import numpy as np
import pytest

from studies.study.cases import CASES
from studies.study.narrow import CELL, KINDS, NARROW, draw_place, why_too_small
from studies.study.stuck import Floor, Stand, find_stuck
from zteam.team.file.reading import read_team_file
from zteam.team.launch.check import check_team
from zteam.world import load_world

_WORLD = """
interval_sim 100
define wall model ( size [10 0.1 1] )
wall ( pose [0 0.5 0 0] )
wall ( pose [0 -0.5 0 0] )
wall ( size [0.1 1 1] pose [-1 0 0 0] )
"""
"""A corridor of 0.9 m with a dead end at x = -1."""


@pytest.fixture(scope="module")
def floor(tmp_path_factory: pytest.TempPathFactory) -> Floor:
    """That corridor."""
    path = tmp_path_factory.mktemp("worlds") / "corridor.world"
    path.write_text(_WORLD)
    return Floor(load_world(path))


@pytest.mark.parametrize("name", [f"{kind}-{team}" for kind in KINDS for team in (12, "circle")])
def test_a_drawn_team_can_start(name: str, tmp_path: Path) -> None:
    """The robots stand free in a world that a seed draws again."""
    case = CASES[name]
    for seed in (1, 2):
        check_team(read_team_file(case.write(tmp_path, seed)))
        drawn = [draw_place(NARROW[name].kind, seed, case.robots) for _ in range(2)]
        assert drawn[0][0].tobytes() == drawn[1][0].tobytes()
        assert drawn[0][2] == drawn[1][2]


def test_rooms_that_a_line_cannot_go_round() -> None:
    """Five of twenty seeds draw one room whose walls are too short a way for 12 robots; 4 and 8 have room in all."""
    found = {count: [seed for seed in range(1, 21) if why_too_small("rooms", seed, count)] for count in (4, 8, 12)}
    assert found == {4: [], 8: [], 12: [1, 5, 12, 15, 19]}
    assert not any(why_too_small(kind, 1, 12) for kind in KINDS if kind != "rooms")


@pytest.mark.parametrize("kind", KINDS)
def test_a_drawn_place_is_one(kind: str) -> None:
    """Each free cell can be reached from each other one, and walls stand around all."""
    for seed in range(1, 6):
        free = draw_place(kind, seed, 12)[0]
        assert not (free[0].any() or free[-1].any() or free[:, 0].any() or free[:, -1].any())
        reached = np.zeros_like(free)
        reached[tuple(np.argwhere(free)[0])] = True
        for _ in range(round(sum(free.shape) / CELL)):
            grown = reached.copy()
            grown[1:] |= reached[:-1]
            grown[:-1] |= reached[1:]
            grown[:, 1:] |= reached[:, :-1]
            grown[:, :-1] |= reached[:, 1:]
            grown &= free
            if (grown == reached).all():
                break
            reached = grown
        assert (reached == free).all()


@pytest.mark.parametrize(
    ("pose", "others", "leads"),
    [
        ((0.0, 0.0, 0.0), [], True),
        # It turns round, or drives back.
        ((0.0, 0.0, 3.1), [], True),
        ((-0.6, 0.0, 1.6), [], True),
        ((-0.6, 0.0, 0.0), [(0.2, 0.0, 0.0)], False),
        # One beside the way leaves no room in a corridor.
        ((-0.6, 0.0, 0.0), [(0.2, 0.1, 0.0)], False),
        ((-0.6, 0.0, 0.0), [(2.5, 0.0, 0.0)], True),
    ],
)
def test_a_way_out_has_room_for_the_robot(
    floor: Floor, pose: tuple[float, float, float], others: list[tuple[float, float, float]], leads: bool
) -> None:
    """In a corridor with a dead end, past other robots or not."""
    assert floor.has_way(np.array(pose), np.array(others).reshape(-1, 3), np.array(pose)) is leads


def stuck(
    floor: Floor, *tracks: list[float], waits: dict[int, int] | None = None, line: bool = True, leads_from: int = 0
) -> list[Stand]:
    """Robots at these places along the corridor, one a second; each follows the one before it, the first from a second
    on none."""
    poses = np.array([[(x, 0.0, 0.0) for x in row] for row in zip(*tracks, strict=True)])
    follows = {robot: robot - 1 for robot in range(len(tracks))}
    followed = [follows | ({0: 9} if second < leads_from else {}) for second in range(len(poses))]
    return find_stuck(floor, poses, 1.0, followed, [waits or {}] * len(poses), is_line=line)


def test_who_is_stuck(floor: Floor) -> None:
    """A robot that stays for half a minute, unless it waits for one that gets on; a head of a line within 2 m."""
    stays, away = [0.0] * 61, [2.0 + 0.04 * second for second in range(61)]
    assert [each.robot for each in stuck(floor, away, stays)] == [1]
    assert stuck(floor, away, stays, waits={1: 0}) == []
    assert [each.robot for each in stuck(floor, stays, [-0.8] * 61, waits={1: 0})] == [0]
    first = stuck(floor, away, [0.0] * 41 + [0.6] * 20)
    assert [(each.robot, each.begin) for each in first] == [(1, 0.0)]
    to_and_fro = [0.9 * (second % 2) for second in range(71)]
    assert [each.robot for each in stuck(floor, to_and_fro)] == [0]
    assert stuck(floor, to_and_fro, line=False) == []
    assert stuck(floor, to_and_fro, leads_from=20) == []
