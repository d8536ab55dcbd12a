"""The logs of a team's processes in one place."""

import json
from pathlib import Path

import pytest

from zteam.team.testing.team import TeamFixture

pytestmark = pytest.mark.team

BEHAVIOR = """
import logging
from zteam import Behavior

log = logging.getLogger(__name__)
log.info("imported")

class Talker(Behavior):
    def step(self, view):
        log.info("steps")
        raise ValueError("out of plans")
"""


def once(team: TeamFixture, *arguments: str) -> list[tuple[str, str, str]]:
    """(process, level, text) of the lines that `zteam log --once` prints."""
    done = team.command("log", "--once", "--json", *arguments)
    assert done.returncode == 0, done.stderr
    lines = [json.loads(line) for line in done.stdout.splitlines()]
    assert [line["time_ns"] for line in lines] == sorted(line["time_ns"] for line in lines)
    return [(line["process"], line["level"], line["text"]) for line in lines]


def test_the_logs_of_a_team_are_read_in_one_place(team: TeamFixture) -> None:
    """`zteam log --once` prints what living processes log, also before they were on the bus, and chooses by name and
    level; it refuses a name that no process has."""
    team.start("arena", robots=2, behavior="forward")
    team.wait_for_go()
    team.wait_for_line("robot_1", "behaviour forward")
    told = once(team)
    assert ("robot_1", "info", "behaviour forward") in told
    assert ("monitor", "info", "All robots GO!") in told
    assert any(process == "sim" and text.startswith("arena: ") for process, _, text in told)
    assert {process for process, _, _ in once(team, "robot_*")} == {"robot_0", "robot_1"}
    assert once(team, "-n", "2", "robot_1") == [line for line in told if line[0] == "robot_1"][-2:]
    assert ("robot_1", "info", "behaviour forward") not in once(team, "--level", "error")

    refused = team.command("log", "robto_1")
    assert refused.returncode == 1
    assert refused.stderr == "zteam log: no process robto_1; alive: monitor, robot_0, robot_1, sim, tf\n"


@pytest.mark.real_time
def test_a_follower_sees_a_process_from_its_start_to_its_end(team: TeamFixture, tmp_path: Path) -> None:
    """`zteam log` prints what a robot logged before it joined, each line once, and the error that ended it; what a
    user's module logs is included."""
    (tmp_path / "talker.py").write_text(BEHAVIOR)
    team.spawn("zteam-sim", "arena", name="sim")
    team.wait_for_processes("sim")
    team.spawn("zteam", "log", "--json", name="log")
    team.wait_for_line("log", '"process":"sim"')
    team.spawn(
        "zteam-robot", "--id", "0", "--behavior", "talker:Talker", "--path", str(tmp_path), "--no-gate", name="robot_0"
    )
    assert team.wait_for_exit("robot_0") == 1
    team.wait_for_line("log", "out of plans")
    lines = [json.loads(line) for line in team.lines("log")]
    robot = [line["text"] for line in lines if line["process"] == "robot_0"]
    assert robot[0] == "imported"
    assert robot.count("imported") == robot.count("steps") == 1
    (end,) = (text for text in robot if text.startswith("ended by an error"))
    assert end.endswith("ValueError: out of plans")
