"""The main job: a line that drives."""

from pathlib import Path

import pytest

from support.paces import BOTH_PACES
from zteam.config.resources import shipped_team, shipped_world
from zteam.team.testing.team import TeamFixture

WALLS = """
wall ( name "south" pose [0 -3.95 0 0] size [12 0.1 0.5] )
wall ( name "north" pose [0  3.95 0 0] size [12 0.1 0.5] )
wall ( name "west"  pose [-5.95 0 0 90] size [8 0.1 0.5] )
wall ( name "east"  pose [ 5.95 0 0 90] size [8 0.1 0.5] )
wall ( name "between_0" pose [-2 1.5 0 90] size [5 0.1 0.5] )
wall ( name "between_1" pose [ 2 1.5 0 90] size [5 0.1 0.5] )
erratic ( name "robot_0" pose [ 0.0 -2.5 0 0] )
erratic ( name "robot_1" pose [-1.2 -2.5 0 0] )
erratic ( name "robot_2" pose [-2.4 -2.5 0 0] )
erratic ( name "robot_3" pose [-3.6 -2.5 0 0] )
"""
"""A way of 12 m with three bays, each 4 m wide and 5 m deep."""


@pytest.mark.ci
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_line_drives_among_dead_ends(team: TeamFixture, tmp_path: Path, seed: int) -> None:
    """With each seed the shipped line drives a minute among dead ends: no robot collides or falls behind."""
    arena, line = shipped_world("arena"), shipped_team("line")
    assert arena is not None and line is not None
    (tmp_path / "bays.world").write_text(arena.read_text().partition("wall (")[0] + WALLS)
    (tmp_path / "line.toml").write_text(line.read_text().replace("seed = 1\n", f"seed = {seed}\n"))
    team.launch(tmp_path / "line.toml", world=tmp_path / "bays.world", in_process=True)
    team.wait_for_go()
    standing = 0
    for _ in range(60):
        before = [team.robot(robot).distance_travelled for robot in range(4)]
        team.run(1.0)
        driven = max(team.robot(robot).distance_travelled - before[robot] for robot in range(4))
        standing = 0 if driven > 0.05 else standing + 1
        assert standing < 10
    report = team.report
    assert report.seed == seed
    assert [robot.stalls for robot in report.robots] == [0] * 4
    assert min(robot.distance_m for robot in report.robots) > 5.0
    assert max(robot.gap_m.max for robot in report.robots if robot.gap_m is not None) < 3.0


IN_A_CORNER = ((49.04, 10.98, -2.64), (48.58, 11.40, -2.10), (48.36, 11.89, 0.35), (48.93, 12.03, 0.97))
AT_AN_END = ((42.07, 48.92, -1.22), (42.02, 48.11, 1.90), (41.42, 48.54, 1.58), (41.22, 49.12, 2.80))
"""Places in the office where the two ends of a line had no way out but through its middle (m, m, rad)."""


@pytest.mark.ci
@BOTH_PACES
@pytest.mark.parametrize("places", [IN_A_CORNER, AT_AN_END])
def test_a_line_gets_out_whose_ends_are_both_shut_in(
    team: TeamFixture, tmp_path: Path, places: tuple[tuple[float, float, float], ...]
) -> None:
    """After both ends have handed over in vain the robots between them make way: in 150 s each one drives 2 m."""
    robots = "".join(
        f'[[robots]]\nid = {i}\nmodel = "erratic"\npose = {list(place)}\n'
        + (f"follow = {i - 1}\n" if i else 'behavior = "wander"\nspeed = 0.4\n')
        for i, place in enumerate(places)
    )
    (tmp_path / "line.toml").write_text(f'[team]\nworld = "office"\nworld_robots = false\n{robots}')
    team.launch(tmp_path / "line.toml", in_process=True)
    team.wait_for_go()
    team.until(lambda: min(team.robot(robot).distance_travelled for robot in range(4)) > 2.0, within=150.0)
    assert [robot.stalls for robot in team.report.robots] == [0] * 4
