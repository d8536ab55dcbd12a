"""Goals sent by the tools to a running team: `zteam goto`, `zteam goals`, `zteam.BasicNavigator`."""

import json
import math
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from support.limits import LIMIT
from support.pages import DOCS, find_file
from support.terminal import TerminalCommand
from zteam.team.launch.process import zteam_command
from zteam.team.testing.team import TeamFixture

pytestmark = pytest.mark.team

NAVIGATED = """
[team]
world = "arena"
[[robots]]
ids = "0-1"
navigation = {localizer = "fake"}
"""
WITH_GOALS = (
    NAVIGATED
    + """
[[nodes]]
name = "goals"
command = ["zteam", "goals", "goals.yaml", "--json"]
expect = true
[[nodes]]
name = "visitor"
command = ["python", "visitor.py"]
expect = true
"""
)
VISITOR = """
from zteam import BasicNavigator, Pose2, run


def main(node):
    navigator, told = BasicNavigator(0, node), []

    def step(now):
        if now == 3_000_000_000:
            navigator.goToPose(Pose2(-2.0, -2.0, 0.0))
        elif now > 3_000_000_000 and not told and navigator.isTaskComplete():
            told.append(print("visited:", navigator.getResult().name, flush=True))

    node.run(step)


run("visitor", main)
"""
"""Sends robot 0 elsewhere while it drives to the first of its goals."""
GOALS = """
- {robot: 0, x: 0.0, y: -1.0}
- {robot: 1, x: -3.5, y: -2.0, yaw: 1.57}
- {robot: 0, x: 1.5, y: 2.5}
- {robot: 0, x: -1.5, y: 0.0}
"""
"""The third one is in a crate."""


def write(folder: Path, name: str, text: str) -> Path:
    """A file with this text."""
    path = folder / name
    path.write_text(text)
    return path


def goto(team: TeamFixture, *words: str) -> tuple[int, dict[str, object]]:
    """Exit code and report of `zteam goto`."""
    done = team.command("goto", *words, "--json", timeout=LIMIT)
    return done.returncode, json.loads(done.stdout)


def distance(team: TeamFixture, robot_id: int, x: float, y: float) -> float:
    """Metres from a robot to a place."""
    pose = team.robot(robot_id).pose
    return math.dist(pose[:2], (x, y))


def test_goto_waits_for_the_robot_and_says_how_it_ended(team: TeamFixture, empty_folder: Path) -> None:
    """A goal that is reached ends with 0, one in a crate with 1 and navigation's reason; cancel finds the next one."""
    team.launch(write(empty_folder, "team.toml", NAVIGATED))
    team.wait_for_go()
    team.sim.resume()
    code, told = goto(team, "0", "0.5", "-1", "1.57")
    assert (code, told["result"], told["driven_by"]) == (0, "succeeded", "navigation")
    assert distance(team, 0, 0.5, -1.0) < 0.5
    code, told = goto(team, "0", "1.5", "2.5")
    assert (code, told["result"]) == (1, "failed")
    assert "in an obstacle" in str(told["text"])
    team.sim.set_speed(1.0)
    code, told = goto(team, "1", "3.5", "3.5", "--no-wait")
    assert (code, told["result"]) == (0, "sent")
    team.wait_for(lambda: team.robot(1).distance_travelled > 0.2)
    team.sim.pause()
    assert goto(team, "--cancel", "1") == (0, {"robot": 1, "canceled": True})
    team.until(lambda: team.robot(1).speed == 0.0, within=3.0)
    assert distance(team, 1, 3.5, 3.5) > 1.0


def test_on_a_terminal_goto_shows_one_line_and_ctrl_c_cancels(team: TeamFixture, empty_folder: Path) -> None:
    """The line is rewritten with what is left; Ctrl+C leaves a robot that stands, and says so."""
    team.launch(write(empty_folder, "team.toml", NAVIGATED))
    team.wait_for_go()
    team.sim.set_speed(1.0)
    team.sim.resume()
    terminal = TerminalCommand(zteam_command("zteam", "goto", "0", "3.5", "-3.5"), team.environment)
    try:
        terminal.wait_for(
            lambda rows: re.fullmatch(r"robot_0: driving, \d\.\d m left, about \d+ s", rows[-1]) is not None
        )
        team.wait_for(lambda: team.robot(0).distance_travelled > 0.2)
        terminal.press(b"\x03")
        code, rows = terminal.end()
    finally:
        terminal.close()
    assert code == 130, rows
    assert any(re.search(r"robot_0: goal canceled after .*: x 3.5, y -3.5, yaw 0: interrupted$", row) for row in rows)
    team.wait_for(lambda: team.robot(0).speed == 0.0)
    assert distance(team, 0, 3.5, -3.5) > 1.0


def test_goto_without_navigation_uses_the_behaviour_go_to(team: TeamFixture) -> None:
    """A robot that runs go_to gets there by its laser, and the command says what drives it."""
    team.start("arena", robots=1, behavior="go_to")
    team.wait_for_go()
    team.sim.resume()
    done = team.command("goto", "0", "0.5", "-1", timeout=LIMIT)
    assert done.returncode == 0, done.stderr
    assert "robot_0 has no navigation: its behaviour go_to drives it" in done.stderr
    assert distance(team, 0, 0.5, -1.0) < 0.5
    team.sim.set_speed(1.0)
    assert team.command("goto", "0", "-2", "-2", "--no-wait", timeout=LIMIT).returncode == 0
    canceled = team.command("goto", "--cancel", "0", timeout=LIMIT)
    assert canceled.stdout == "robot_0: the goal is canceled\n", canceled.stderr
    team.wait_for(lambda: team.robot(0).speed == 0.0)
    again = team.command("goto", "--cancel", "0", timeout=LIMIT)
    assert again.stdout == "robot_0: there was no goal\n", again.stderr


def test_goals_as_a_node_of_lock_step(team: TeamFixture, empty_folder: Path) -> None:
    """Each robot drives to its own goals in turn, but first where another program sends it. A goal in a crate is
    passed over."""
    write(empty_folder, "team.toml", WITH_GOALS)
    write(empty_folder, "goals.yaml", GOALS)
    write(empty_folder, "visitor.py", VISITOR)
    # One goal fails, and so does the node in the end.
    team.expect_end("goals")
    team.launch(empty_folder / "team.toml")
    team.wait_for_go()
    team.run(60.0)
    assert "visited: SUCCEEDED" in "".join(team.lines("visitor"))
    told = [json.loads(line) for line in team.lines("goals") if line.startswith("{")]
    assert [(end["line"], end["result"]) for end in told if end["robot"] == 0] == [
        (2, "succeeded"),
        (4, "failed"),
        (5, "succeeded"),
    ]
    assert [(end["line"], end["result"]) for end in told if end["robot"] == 1] == [(3, "succeeded")]
    assert distance(team, 0, -1.5, 0.0) < 0.5
    assert distance(team, 1, -3.5, -2.0) < 0.5
    assert team.exit_code("goals") == 1


def test_the_shipped_navigation_has_no_commands_from_outside(empty_folder: Path) -> None:
    """`zteam up navigation --lockstep`, twice: its one navigation holds a name for each of four robots and takes part
    under one of them. Both reports count no external command, and the runs are the same."""
    found = []
    for name in ("first.json", "second.json"):
        command = zteam_command("zteam", "up", "navigation", "--lockstep", "--for", "6", "--report", name)
        subprocess.run(command, cwd=empty_folder, check=True, timeout=LIMIT, stdin=subprocess.DEVNULL)
        report = json.loads((empty_folder / name).read_text())
        found.append((report["external_commands"], report["trajectory_sha256"]))
    assert found == [(0, found[0][1])] * 2


def test_the_script_of_the_page_drives_a_robot(team: TeamFixture, empty_folder: Path) -> None:
    """`zteam.BasicNavigator` with Nav2's names, in a process of its own beside a team at a user's pace."""
    write(empty_folder, "team.toml", NAVIGATED.replace("arena", "office"))
    team.launch(empty_folder / "team.toml")
    team.wait_for_go()
    team.sim.set_speed(2.0)
    team.sim.resume()
    script = find_file("tour.py", DOCS / "navigation.md").save(empty_folder)
    script.write_text(script.read_text().replace("    tour()\n", "    print(tour().name)\n"))
    around = {**os.environ, **team.environment}
    done = subprocess.run(
        [sys.executable, str(script)], env=around, capture_output=True, text=True, timeout=LIMIT, check=False
    )
    assert done.stdout.splitlines()[-1:] == ["SUCCEEDED"], done.stdout + done.stderr
    assert "m left to waypoint 1" in done.stdout
    assert distance(team, 1, 11.0, 25.0) < 0.5


def test_the_node_of_the_page_patrols_in_lock_step(team: TeamFixture, empty_folder: Path) -> None:
    """A navigator in a node holds nothing up: the world goes on tick by tick, and the robot drives to and fro."""
    node = '[[nodes]]\nname = "patrol"\ncommand = ["python", "patrol.py"]\nexpect = true\n'
    write(empty_folder, "team.toml", NAVIGATED.replace("arena", "office") + node)
    find_file("patrol.py", DOCS / "navigation.md").save(empty_folder)
    team.launch(empty_folder / "team.toml")
    team.wait_for_go()
    for _ in range(2):
        team.until(lambda: distance(team, 1, 12.5, 25.0) < 0.4, within=40.0)
        team.until(lambda: distance(team, 1, 11.0, 25.0) < 0.4, within=40.0)


def test_the_map_of_a_team_file_takes_the_place_of_the_simulators(team: TeamFixture, empty_folder: Path) -> None:
    """One process publishes `map`, and it is the one that the file names."""
    for name in ("hall.yaml", "hall.pgm"):
        find_file(name, DOCS / "navigation.md").save(empty_folder)
    text = '[team]\nworld = "arena"\nmap = "hall.yaml"\n[[robots]]\nid = 0\nbehavior = "idle"\n'
    team.launch(write(empty_folder, "team.toml", text))
    info = json.loads(team.command("topic", "info", "map", "--json").stdout)
    assert info["publishers"] == ["map"]
    grid = json.loads(team.command("topic", "echo", "map", "--once", "--json").stdout)
    assert (grid["info"]["width"], grid["info"]["height"]) == (8, 6)
