"""What a running team's processes say of themselves: statuses, the monitor's table, ids that the world lacks."""

import pytest

from zteam import names
from zteam.team.testing.team import TeamFixture


def test_a_second_monitor_shows_the_team_of_the_first(team: TeamFixture) -> None:
    """It says that a monitor runs, shows what each robot does and where it is, and ends once the team runs."""
    team.start("arena", robots=2, behavior="forward", params={0: {"speed": 0.05}}, follow={1: 0})
    team.wait_for_go()
    view = team.spawn("zteam-monitor", "--table", "0.5")
    team.wait_for_line(view, "a monitor is running already (process ")
    team.run(1.0)
    team.wait_for_line(view, "robot_1  running  follow robot_0  ")
    team.wait_for_line(view, "  0.05  ")
    (x, *_) = team.robot(0).pose
    team.wait_for_line(view, f"{x:.2f}")
    team.wait_for_line(view, "GO is out")
    assert team.wait_for_exit(team.spawn("zteam-monitor", "--team-size", "3", "--exit-on-go", name="late")) == 0
    team.kill(names.AGGREGATOR)
    for name in (view, names.MONITOR):
        team.wait_for_line(name, "the aggregator is gone: there are no new transforms")


@pytest.mark.real_time
def test_an_id_that_the_world_lacks_is_named(team: TeamFixture) -> None:
    """The robot and the monitor say which robots there are and how to add the one that is missing; then GO follows."""
    team.spawn("zteam-sim", "arena", name=names.SIMULATOR)
    team.spawn("zteam-tf", name=names.AGGREGATOR)
    team.spawn("zteam-robot", "--id", "9", "--behavior", "forward", name="robot_9")
    team.spawn("zteam-monitor", "--ids", "9", name=names.MONITOR)
    lacks = "not in the world; it has 0, 1 ('zteam sim spawn --id 9 --pose X Y YAW' adds it)"
    team.wait_for_line("robot_9", f"boot: waiting for its first scan: robot_9 is {lacks}")
    team.wait_for_line(names.MONITOR, f"waiting for robot_9: {lacks}")
    team.wait_for(lambda: team.status.waiting_for == f"robot_9: {lacks}")
    team.sim.spawn(2.0, 2.0, robot_id=9, force=True)
    team.wait_for_go()
    assert team.status.waiting_for == ""
    team.wait_for(lambda: team.robot(9).status is not None)
    status = team.robot(9).status
    assert (status.behavior, status.leader) == ("forward", -1)


@pytest.mark.parametrize("in_process", [False, True])
def test_the_status_says_why_a_robot_stands(team: TeamFixture, in_process: bool) -> None:
    """In front of a wall: driver, reason and speed in the status, and one line of the safety layer in the log."""
    team.start("arena", robots=1, behavior="forward", params={0: {"speed": 0.5}}, in_process=in_process)
    team.wait_for_go()
    team.until(lambda: team.robot(0).status.reason == "obstacle ahead", within=60.0)
    status = team.robot(0).status
    assert (status.behavior, status.driver, status.speed) == ("forward", "behavior", 0.0)
    team.run(5.0)
    told = [line for line in team.lines("robot_0") if "safety: stopped forward (0.50 m/s): obstacle ahead" in line]
    assert len(told) == 1


@pytest.mark.real_time
def test_the_end_of_a_lone_simulator_is_told(team: TeamFixture) -> None:
    """The row has no speed and says how long there has been no data; doctor names the process that is missing first."""
    team.spawn("zteam-sim", "arena", name=names.SIMULATOR)
    team.spawn("zteam-tf", name=names.AGGREGATOR)
    team.spawn("zteam-robot", "--id", "0", "--behavior", "forward", "--param", "speed=0.05", name="robot_0")
    team.spawn("zteam-monitor", "--ids", "0", "--table", "0.5", name=names.MONITOR)
    team.wait_for_go()
    team.wait_for_line(names.MONITOR, "  0.05  ")
    team.kill(names.SIMULATOR)
    team.wait_for_line(names.MONITOR, "the simulator is gone: time stands still")
    team.wait_for_line(names.MONITOR, "no data for ")
    after = team.lines(names.MONITOR)
    gone = next(number for number, line in enumerate(after) if "no data for " in line)
    assert not any("  0.05  " in line for line in after[gone:])
    told = team.command("doctor").stdout.splitlines()
    wrong = [line for line in told if line.startswith("problem")]
    assert wrong[0].split()[1:] == ["simulator", "no", "process", "sim"]
    assert not any("has robot" in line for line in told)


@pytest.mark.real_time
def test_robots_that_cannot_follow_are_told_before_go(team: TeamFixture) -> None:
    """A circle gets its line before GO, from monitor and doctor; each process has said what it is and waits for."""
    team.spawn("zteam-sim", "arena", name=names.SIMULATOR)
    team.spawn("zteam-tf", name=names.AGGREGATOR)
    team.spawn("zteam-robot", "--id", "0", "--follow", "1", name="robot_0")
    team.spawn("zteam-monitor", "--ids", "0", "1", name=names.MONITOR)
    team.spawn("zteam-robot", "--id", "1", "--follow", "0", name="robot_1")
    circle = "robots follow each other in a circle: robot_0 -> robot_1 -> robot_0"
    for name, line in (
        (names.AGGREGATOR, "aggregator of transforms: waiting for those of the robots"),
        ("robot_0", "robot 0, behaviour follow behind robot_1: waiting for its data, then for the monitor's GO"),
        (names.MONITOR, "start gate: waiting for robots 0, 1, then GO"),
        (names.MONITOR, "All robots GO!"),
    ):
        team.wait_for_line(name, line)
    lines = team.lines(names.MONITOR)
    told, go = (next(number for number, line in enumerate(lines) if text in line) for text in (circle, "robots GO!"))
    assert told < go
    assert circle in team.command("doctor").stdout
