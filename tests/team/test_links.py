"""Bad links of real processes: cut, late and lossy ones."""

import json
import os
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from support.limits import LIMIT
from zteam import names
from zteam.team.chaos.forwarder import Link, Wire
from zteam.team.launch.process import zteam_command
from zteam.team.testing.team import TeamFixture

pytestmark = pytest.mark.team

CUT = 2.5
"""Host seconds: longer than the lease of real time."""
LATE = Wire(delay=1.6)
LAST_TICK = 60
LOSS = "0.1"


def link_of(team: TeamFixture, name: str) -> Link:
    """The link of a process."""
    assert team._links is not None
    return team._links._links[name]


def test_a_cut_link_does_not_change_a_run_of_lock_step(team: TeamFixture) -> None:
    """The world waits while simulator, aggregator or a robot is cut off, as it does for a frozen one."""
    team.start("office", robots=2, follow={1: 0}, lockstep_timeout=60.0, chaos=True)
    team.wait_for_go()
    hashes = []
    for name in ("", names.SIMULATOR, names.AGGREGATOR, "robot_1"):
        team.sim.reset()
        team.at(20)
        if name:
            assert team._links is not None
            team._links.change(name, Wire(stalled=True), CUT)
        team.at(LAST_TICK)
        hashes.append(team.report.trajectory_sha256)
    assert hashes == hashes[:1] * 4
    assert team.report.hung == []


def test_a_link_that_is_reset_is_told_in_lock_step(team: TeamFixture) -> None:
    """It loses what was on its way, so the run is another one: the report names the robot when it is back."""
    team.start("office", robots=2, follow={1: 0}, chaos=True)
    team.wait_for_go()
    team.expect_end("robot_1")
    link_of(team, "robot_1").reset()
    team.wait_for(lambda: not team.alive("robot_1"))
    team.run(1.0)
    link_of(team, "robot_1").change()
    team.wait_for(lambda: team.report.hung == ["robot_1"])


def late_commands(team: TeamFixture) -> int:
    """Commands of robot_1 that the simulator has refused because they came too late."""
    return next(robot.late_commands for robot in team.report.robots if robot.id == 1)


def stands(team: TeamFixture) -> bool:
    """Whether robot_1 does not move for half a second."""
    before = team.robot(1).pose
    team.run(0.5)
    return team.robot(1).pose == before


@pytest.mark.real_time
def test_old_commands_move_no_robot(team: TeamFixture) -> None:
    """With an uplink that is 1.6 s late robot_1 stands, though its commands come. On a late downlink it leaves out the
    scans, brakes and stands. On a good link it drives again."""
    team.start("office", robots=2, follow={1: 0}, lockstep=False, chaos=True)
    team.wait_for_go()
    robot, link = team.robot(1), link_of(team, "robot_1")
    team.until(lambda: robot.speed > 0.05, within=30.0)
    link.change(up=LATE)
    team.wait_for(lambda: late_commands(team) > 2)
    # What is left of the last command in time.
    team.until(lambda: robot.speed == 0.0, within=10.0)
    assert all(stands(team) for _ in range(2))
    link.change()
    team.until(lambda: robot.speed > 0.05, within=30.0)
    link.change(down=LATE)
    team.wait_for_line("robot_1", f"{names.scan_key(1, 0)}: it came more than 0.5 s late")
    # Its time is late too: it learns after a while that its newest scan is old, and brakes from its last command.
    before = robot.distance_travelled
    team.run(2.0)
    assert robot.distance_travelled - before < 0.1
    link.change()
    team.until(lambda: robot.speed > 0.05, within=30.0)


@pytest.fixture
def lossy_namespace() -> Iterator[str]:
    """A network namespace whose loopback interface loses one of ten packets."""
    name = f"zteam_loss_{os.getpid()}"
    if shutil.which("ip") is None or subprocess.run(["ip", "netns", "add", name], capture_output=True).returncode:
        pytest.skip("no network namespace can be made here: needs root and iproute2")
    inside = ("ip", "netns", "exec", name)
    netem = ("tc", "qdisc", "add", "dev", "lo", "root", "netem", "loss", "10%")
    statistic = ("iptables", "-A", "INPUT", "-p", "tcp", "-m", "statistic", "--mode", "random", "--probability", LOSS)
    try:
        subprocess.run([*inside, "ip", "link", "set", "lo", "up"], check=True)
        ways = (netem, (*statistic, "-j", "DROP"))
        if not any(subprocess.run([*inside, *way], capture_output=True).returncode == 0 for way in ways):
            pytest.skip("this kernel has neither netem nor iptables' statistic")
        yield name
    finally:
        subprocess.run(["ip", "netns", "del", name], check=True)


@pytest.mark.real_time
def test_a_team_drives_where_one_of_ten_packets_is_lost(lossy_namespace: str, tmp_path: Path) -> None:
    """TCP repeats them: all robots drive, and the run ends well."""
    run = zteam_command("zteam", "up", "line", "--for", "6", "--report", "run.json")
    command = ["ip", "netns", "exec", lossy_namespace, *run]
    done = subprocess.run(
        command, cwd=tmp_path, capture_output=True, text=True, timeout=LIMIT, check=False, stdin=subprocess.DEVNULL
    )
    assert done.returncode == 0, done.stdout + done.stderr
    robots = json.loads((tmp_path / "run.json").read_text())["robots"]
    assert len(robots) == 4
    assert all(robot["distance_m"] > 0.0 for robot in robots), robots
