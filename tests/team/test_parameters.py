"""Parameters of robots that run, through the command line and in lock-step."""

import pytest

from zteam import names
from zteam.messages import RobotStatus
from zteam.robot.client import ParametersClient
from zteam.team.testing.team import TeamFixture

pytestmark = pytest.mark.team


@pytest.mark.parametrize("in_process", [False, True])
def test_a_set_at_the_same_tick_gives_the_same_run(team: TeamFixture, in_process: bool) -> None:
    """A run with a set repeats bit for bit if the set comes at the same tick."""
    found: list[str] = []
    team.start("arena", robots=2, follow={1: 0}, params={0: {"speed": 0.2}}, in_process=in_process)
    team.wait_for_go()
    client = ParametersClient(team.bus)
    for _ in range(2):
        client.set("robot_0", {"speed": 0.2})
        team.sim.reset()
        team.run(2)
        client.set("robot_0", {"speed": 0.4})
        team.run(5)
        found.append(team.report.trajectory_sha256)
    assert found[0] == found[1]


def test_a_follower_gets_another_leader(team: TeamFixture) -> None:
    """A set `leader` counts from the next tick on: the robot waits for the new one, and drives again after the old."""
    team.start("arena", robots=2, behavior="wander", follow={1: 0})
    team.wait_for_go()
    follower = team.robot(1)
    team.until(lambda: follower.distance_travelled > 0.5, within=40)
    statuses: list[RobotStatus] = []
    team.bus.subscribe(names.robot_key(1, names.STATUS), RobotStatus, lambda _, status: statuses.append(status))
    assert team.command("param", "set", "1", "leader", "7").returncode == 0
    team.run(1)
    team.wait_for(lambda: any(status.text == "leader robot_7 not seen" for status in statuses))
    assert follower.speed < 0.01
    assert team.command("param", "set", "1", "leader", "0").returncode == 0
    driven = follower.distance_travelled
    team.until(lambda: follower.distance_travelled > driven + 0.5, within=40)
