"""`zteam up --in-process --bus`: the tools of a team of processes, on a team in one process."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import msgspec
import pytest

import zteam
from support.limits import LIMIT
from zteam.bus.options import port_accepts
from zteam.team.launch.process import zteam_command
from zteam.team.testing.team import TeamFixture

pytestmark = pytest.mark.team

ARENA = ("sim", "tf", "monitor", "robot_0", "robot_1", "up")
CROWD = """
from zteam import Node, run
from zteam.messages import Odometry

def main(node: Node) -> None:
    node.subscribe("robot_$*/base_pose_ground_truth", Odometry, lambda key, truth: None, every_tick=True)
    node.run(lambda now: None)

if __name__ == "__main__":
    run("crowd", main)
"""


def start(team: TeamFixture, *options: str) -> None:
    """Start the arena with its tools' router; return when all robots drive."""
    team.spawn("zteam", "up", "arena", "--in-process", "--bus", "--lockstep", *options, name="team")
    team.wait_for_line("team", "All robots GO!")


def told(team: TeamFixture, *arguments: str) -> str:
    """What a tool prints; it must succeed."""
    done = team.command(*arguments)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def users(team: TeamFixture, *options: str) -> dict[str, tuple[str, list[str], list[str]]]:
    """What `zteam topic list` tells of each key: type, publishers, subscribers."""
    rows = msgspec.json.decode(told(team, "topic", "list", "--json", *options))
    return {row["key"]: (row["type"], row["publishers"], row["subscribers"]) for row in rows}


def test_the_keys_and_their_users_are_those_of_processes(team: TeamFixture) -> None:
    """`zteam topic list` names the same keys, publishers and subscribers as for the same team of processes."""
    # The fixture's own session would be one more subscriber in its namespace.
    one, many = f"{team.namespace}_one", f"{team.namespace}_many"
    start(team, "--speed", "1", "--namespace", one)
    team.spawn("zteam", "up", "arena", "--lockstep", "--speed", "1", "--namespace", many, name="processes")
    team.wait_for_line("processes", "All robots GO!")
    found = users(team, "--namespace", one)
    assert found == users(team, "--namespace", many)
    assert found["robot_1/base_scan"] == ("sensor_msgs/msg/LaserScan", ["sim"], ["robot_1"])
    info = msgspec.json.decode(told(team, "topic", "info", "robot_0/base_scan", "--json", "--namespace", one))
    assert (info["writers"], info["publishers"], info["subscribers"]) == (["sim"], ["sim"], ["robot_0"])
    assert info["receivers"]["robot_0"]["received"] > 0


def test_tools_that_look_change_nothing(team: TeamFixture) -> None:
    """Each tool finds what it looks for while the team runs, and the run is the same as without tools."""
    start(team, "--speed", "1")
    team.spawn("zteam-monitor", name="view")
    team.spawn("zteam", "topic", "echo", "**", name="echo")
    team.wait_for_line("echo", "ranges:")
    nodes = [line.split()[0] for line in told(team, "node", "list").splitlines()]
    assert set(ARENA) <= set(nodes)
    assert "lock-step         yes" in told(team, "sim", "status")
    assert "robot_1/base_footprint" in told(team, "tf", "tree")
    assert "Translation" in told(team, "tf", "echo", "map", "robot_0/base_footprint", "--once")
    assert "ranges:" in told(team, "topic", "echo", "robot_0/base_scan", "--once")
    assert "width:" in told(team, "topic", "echo", "map", "--once")
    assert "average rate" in told(team, "topic", "hz", "robot_0/odom", "--once")
    assert "stop_distance" in told(team, "param", "list", "robot_0")
    assert "[robot_0] behaviour wander" in told(team, "log", "--once")
    assert "no problems" in told(team, "doctor")
    team.wait_for_line("view", "GO is out; 2 of 2 ready")
    told(team, "sim", "pause")
    report = team.report
    assert report.external_commands == 0
    alone = zteam.run_team("arena", until=team.sim_status.tick + 1)
    assert (report.ticks, report.trajectory_sha256) == (alone.ticks, alone.trajectory_sha256)


def test_a_process_takes_part(team: TeamFixture, tmp_path: Path) -> None:
    """An own node in a process of its own takes part in lock-step from the first tick on, without changing the run."""
    (tmp_path / "crowd.py").write_text(CROWD)
    report = tmp_path / "r.json"
    up = ("up", "arena", "--in-process", "--bus", "--lockstep", "--for", "3", "--report", str(report))
    team.spawn("zteam", *up, "--expect", "crowd", name="team")
    team.wait_for_processes("sim")
    environment = {**os.environ, **team.environment, "ZTEAM_LEASE": "15"}
    crowd = subprocess.Popen([sys.executable, str(tmp_path / "crowd.py")], env=environment)
    try:
        assert team.wait_for_exit("team") == 0
    finally:
        crowd.terminate()
        crowd.wait(LIMIT)
    told_by_run = json.loads(report.read_text())
    assert "crowd" in told_by_run["rounds"]
    assert told_by_run["trajectory_sha256"] == zteam.run_team("arena", seconds=3.0).trajectory_sha256


def test_nothing_is_left(tmp_path: Path) -> None:
    """Without --connect the team has a router of its own, which tools find; after Ctrl+C nothing listens there."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith("ZTEAM_")}
    launcher = subprocess.Popen(
        zteam_command("zteam", "up", "arena", "--in-process", "--bus", "--speed", "1"),
        cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=environment,
    )  # fmt: skip
    assert launcher.stdout is not None
    endpoint = ""
    try:
        for line in launcher.stdout:
            if "router at " in line:
                endpoint = line.partition("router at ")[2].partition(";")[0]
            if "All robots GO!" in line:
                break
        children = Path(f"/proc/{launcher.pid}/task/{launcher.pid}/children").read_text()
        done = subprocess.run(
            zteam_command("zteam", "node", "list"), env={**environment, "ZTEAM_CONNECT": endpoint},
            capture_output=True, text=True, timeout=LIMIT, check=False,
        )  # fmt: skip
        assert all(name in done.stdout for name in ARENA), done.stdout + done.stderr
        launcher.send_signal(signal.SIGINT)
        launcher.communicate(timeout=LIMIT)
    finally:
        launcher.kill()
        launcher.wait()
    assert launcher.returncode == 0
    assert not children.split()
    assert not port_accepts(endpoint)
