"""Runs repeat bit for bit."""

from pathlib import Path

import pytest

from zteam import names, run_team
from zteam.team.testing.team import TeamFixture

pytestmark = pytest.mark.team

LINE = {1: 0, 2: 1}
TEAM = """
[team]
world = "office"
seed = 1
[[robots]]
id = 0
behavior = "wander"
speed = 0.4
[[robots]]
ids = "1-2"
follow = "previous"
"""


def test_processes_in_any_order_give_the_same_run(team: TeamFixture, tmp_path: Path) -> None:
    """Processes that start in any order give the same trajectory hash as the same team in one process."""
    team.spawn("zteam-robot", "--id", "2", "--follow", "1", name="robot_2")
    team.spawn("zteam-robot", "--id", "1", "--follow", "0", name="robot_1")
    team.spawn("zteam-robot", "--id", "0", "--behavior", "wander", "--param", "speed=0.4", name="robot_0")
    team.spawn("zteam-monitor", "--ids", "0", "1", "2", name=names.MONITOR)
    expected = ("tf", "robot_0", "robot_1", "robot_2")
    team.spawn("zteam-sim", "office", "--lockstep", "--paused", "--expect", *expected, name=names.SIMULATOR)
    team.wait_for_processes("robot_0", "robot_1", "robot_2", names.SIMULATOR)
    team.spawn("zteam-tf", name=names.AGGREGATOR)
    team.wait_for_go()
    team.run(8.0)
    path = tmp_path / "team.toml"
    path.write_text(TEAM)
    assert team.report.trajectory_sha256 == run_team(path, seconds=8.0).trajectory_sha256


@pytest.mark.ci
def test_a_restart_at_a_tick_repeats(team: TeamFixture) -> None:
    """Two runs in which a robot is killed and started again at the same tick have the same trajectory hash."""

    def run() -> str:
        team.at(20).kill("robot_1")
        team.restart("robot_1")
        team.at(60)
        return team.report.trajectory_sha256

    team.start("office", robots=3, follow=LINE)
    team.wait_for_go()
    first = run()
    assert team.robot(1).speed > 0.0
    assert team.sim.reset().tick == 1
    assert run() == first


@pytest.mark.ci
def test_a_run_that_is_reset_at_once_repeats(team: TeamFixture) -> None:
    """Messages of the first ticks of a run, which a reset cuts off there, are not taken for those of the next run."""
    team.start("office", robots=3, follow=LINE)
    team.wait_for_go()
    team.at(60)
    whole = team.report.trajectory_sha256
    for tick in (2, 3, 4, 2):
        team.sim.reset()
        team.at(tick)
        team.sim.reset()
        team.at(60)
        assert team.report.trajectory_sha256 == whole
