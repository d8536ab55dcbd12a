"""Teams in real time."""

import json
import subprocess
from pathlib import Path

import pytest

from support.limits import LIMIT
from support.web_view import open_page
from zteam.team.launch.process import zteam_command
from zteam.team.launch.warm_parent import can_fork
from zteam.team.testing.team import TeamFixture
from zteam.view.frames import POSES, SCAN, TEAM

pytestmark = [pytest.mark.team, pytest.mark.real_time]


def test_the_report_has_every_robot_and_process(tmp_path: Path) -> None:
    """`zteam up` runs a team in real time to its end, and its report has every robot and every process."""
    command = zteam_command("zteam", "up", "arena", "--for", "3", "--report", "r.json")
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=LIMIT, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    report = json.loads((tmp_path / "r.json").read_text())
    assert report["sim_seconds"] >= 3.0
    assert report["wall_seconds"] >= 3.0
    assert 0 < report["go_after_seconds"] < report["wall_seconds"]
    assert report["seed"] == 1
    assert report["external_commands"] == 0
    assert [robot["id"] for robot in report["robots"]] == [0, 1]
    leader, follower = report["robots"]
    assert leader["follow"] is None
    assert leader["gap_m"] is None
    assert follower["follow"] == 0
    assert 0 < follower["gap_m"]["end"] <= follower["gap_m"]["max"]
    assert leader["distance_m"] > 0.2
    # In real time the simulator may hear of GO some ticks after it was given.
    assert 0 < report["ticks"] == leader["scans"]
    processes = {process["name"]: process for process in report["processes"]}
    parent = {"warm_parent"} if can_fork() else set()
    assert set(processes) == {"router", "sim", "tf", "monitor", "robot_0", "robot_1", "up"} | parent
    odd = [p for p in processes.values() if p["exit"] != 0 or not (p["pss_mb"] > 0 and p["cpu_seconds"] > 0)]
    assert not odd, done.stdout + done.stderr
    # A robot drops scans that a crowded machine delivers late; then its next steps are late, too.
    late = {f"robot_{robot['id']}/base_scan" for robot in report["robots"] if robot["late_steps"]}
    assert set(report["dropped"]) <= late
    assert report["safety_stops"] == {"robot_0": 0, "robot_1": 0}


def test_a_page_sees_the_team_of_up(team: TeamFixture) -> None:
    """A page over WebSocket shows poses and scans of the team that `zteam up --view` runs."""
    name = team.spawn("zteam", "up", "line", "--view", "--no-browser")
    team.wait_for_line(name, "the view is at http://127.0.0.1:")
    line = next(line for line in team.lines(name) if "the view is at http" in line)
    port, _, token = line.partition("127.0.0.1:")[2].partition("/#token=")
    with open_page(int(port), token=token.strip()) as page:
        assert page.welcome["may_command"] is True
        page.say(op="look", layers=["scans"], docs=[], beams=90)
        page.wait(lambda: {(POSES, TEAM), *((SCAN, robot) for robot in range(4))} <= page.blocks.keys())
    assert team.stop(name) == 0
