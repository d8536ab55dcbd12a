"""Parameters of robots that run, through the command line and in lock-step."""

import json

import pytest

from zteam import names
from zteam.messages import RobotStatus
from zteam.services.parameters_client import ParametersClient
from zteam.testing.team import TeamFixture

pytestmark = pytest.mark.team


def commanded(team: TeamFixture) -> float:
    """The speed that robot 0 is commanded at the beginning of the next tick."""
    robot = team.robot(0)
    before = robot.commands
    team.run(0.1)
    team.wait_for(lambda: robot.commands > before)
    assert robot.command is not None
    return robot.command.linear.x


def test_a_set_counts_from_the_next_tick_on(team: TeamFixture) -> None:
    """In lock-step the robot commands the new speed in the very next tick; a refused value changes nothing.

    The values that were set outlast a reset of the world.
    """
    team.start("arena", behavior="forward", params={0: {"speed": 0.1}})
    team.wait_for_go()
    team.run(1)
    assert [commanded(team) for _ in range(2)] == [0.1, 0.1]

    done = team.command("param", "set", "robot_0", "speed", "0.3")
    assert (done.returncode, done.stdout) == (0, "robot_0: speed = 0.3\n")
    # The command that a tick shows is the answer to the tick before, which was given before the set.
    assert [commanded(team) for _ in range(3)] == [0.1, 0.3, 0.3]

    refused = team.command("param", "set", "robot_0", "speed", "fast")
    assert refused.returncode == 2
    assert refused.stderr == ('zteam param: robot_0: behaviour forward: speed: a number is expected, not "fast"\n')
    assert [commanded(team) for _ in range(2)] == [0.3, 0.3]

    team.sim.reset()
    team.run(1)
    assert commanded(team) == 0.3
    (listed,) = json.loads(team.command("param", "list", "--json").stdout)
    assert (listed["name"], listed["parameters"][0]["value"]) == ("robot_0", 0.3)
    assert team.command("param", "dump", "0").stdout == 'behavior = "forward"\nspeed = 0.3\n'


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
