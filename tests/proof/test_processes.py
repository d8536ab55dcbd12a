"""Processes that start, end and die."""

import shlex

import pytest

from support.pages import ROOT, blocks_of
from zteam import names
from zteam.messages import Twist
from zteam.team.testing.team import TeamFixture

pytestmark = pytest.mark.team


def test_a_killed_robot_stops_and_comes_back(team: TeamFixture) -> None:
    """A killed robot stops within 0.3 s while the others drive on; when it is started again, it gets GO and drives."""
    params = {0: {"speed": 0.1}, 1: {"speed": 0.1}}
    # A world that waited for the killed robot would wait for ten minutes.
    team.start("arena", robots=2, behavior="forward", params=params, lockstep_timeout=600.0)
    team.wait_for_go()
    team.until(lambda: team.robot(0).speed > 0.05 and team.robot(1).speed > 0.05, within=10)
    team.kill("robot_0")
    killed = team.now
    team.until(lambda: team.robot(0).speed == 0.0, within=5)
    assert team.now - killed <= 0.3 + 1e-9
    team.wait_for(lambda: team.status is not None and 0 in team.status.lost)
    commands = team.robot(1).commands
    team.until(lambda: team.robot(1).commands > commands + 3, within=5)
    team.restart("robot_0")
    team.until(lambda: team.robot(0).speed > 0.05, within=10)
    assert any("robot_0 lost" in line for line in team.lines(names.MONITOR))
    team.wait_for(lambda: any("told GO" in line for line in team.lines(names.MONITOR)))


@pytest.mark.parametrize("victim", [names.AGGREGATOR, names.MONITOR])
def test_the_rest_goes_on_without(team: TeamFixture, victim: str) -> None:
    """Robots drive on without aggregator or monitor, which join the running team when they are started again."""
    team.start("arena", robots=2, behavior="forward", params={0: {"speed": 0.05}, 1: {"speed": 0.05}})
    team.wait_for_go()
    team.until(lambda: team.robot(1).speed > 0.02, within=10)
    epoch = team.status.epoch
    team.kill(victim)
    start = team.robot(1).commands
    team.until(lambda: team.robot(1).commands > start + 10, within=5)
    assert team.robot(1).speed > 0.02
    team.restart(victim)
    start = team.robot(1).commands
    team.until(lambda: team.robot(1).commands > start + 10, within=5)
    assert team.robot(1).speed > 0.02
    if victim == names.MONITOR:
        team.wait_for_line(victim, f"the team is running already (epoch {epoch})")
    # A new monitor begins with epoch 0, until it has heard the robots.
    team.wait_for(lambda: team.status.epoch == epoch)


def test_a_killed_simulator_comes_back(team: TeamFixture) -> None:
    """When a killed simulator is started again, the robots drive on without a new GO."""
    team.start("arena", robots=1, behavior="forward", params={0: {"speed": 0.05}})
    team.wait_for_go()
    team.until(lambda: team.robot(0).speed > 0.02, within=10)
    team.kill(names.SIMULATOR)
    old = team.robot(0).truth
    team.restart(names.SIMULATOR)
    team.until(lambda: team.robot(0).truth is not old and team.robot(0).speed > 0.02, within=20)


def test_an_id_is_held_by_one_process(team: TeamFixture) -> None:
    """A second robot_0 refuses to start and names the process that holds the id, which drives on."""
    team.start("arena", robots=1, behavior="forward", params={0: {"speed": 0.05}})
    team.wait_for_go()
    second = team.spawn("zteam-robot", "--id", "0", name="second")
    assert team.wait_for_exit(second) == 1
    said = "\n".join(team.lines(second))
    assert f"robot_0 is taken by process {team.pid('robot_0')}" in said
    commands = team.robot(0).commands
    team.until(lambda: team.robot(0).commands > commands + 3, within=5)


def test_a_stopped_robot_leaves_a_zero_velocity(team: TeamFixture) -> None:
    """A robot that is asked to stop sends a zero velocity and ends with exit code 0."""
    team.start("arena", robots=1, behavior="forward", params={0: {"speed": 0.1}})
    team.wait_for_go()
    team.until(lambda: team.robot(0).speed > 0.05 and team.robot(0).command is not None, within=10)
    assert team.stop("robot_0") == 0
    assert team.robot(0).command == Twist()
    assert not team.alive("robot_0")
    team.until(lambda: team.robot(0).speed == 0.0, within=0.3)


@pytest.mark.real_time
def test_the_processes_of_the_readme_start_in_any_order(team: TeamFixture) -> None:
    """The README's processes, started by hand from the last to the first, find each other, and all robots GO."""
    (block,) = (block for block in blocks_of(ROOT / "README.md") if block.code.startswith("zteam-sim "))
    commands = [shlex.split(line) for line in block.code.splitlines()]
    assert commands[0][0] == "zteam-sim" and len(commands) == 5
    for command in reversed(commands):
        team.spawn(*command, name=f"robot_{command[2]}" if command[0] == "zteam-robot" else command[0][6:])
    team.wait_for_line(names.MONITOR, "All robots GO!")
    team.wait_for(lambda: team.robot(1).distance_travelled > 0.05)
