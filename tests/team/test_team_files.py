"""Team files as launch files: the shipped chain, a node as a member of the team, and restarts."""

import json
import re
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from support.limits import LIMIT
from zteam.team.launch.process import zteam_command
from zteam.team.testing.team import TeamFixture

pytestmark = pytest.mark.team


COUNTER = """
import logging, sys
import zteam
from zteam.messages import LaserScan

def main(node):
    ticks = []
    node.subscribe("robot_0/base_scan", LaserScan, lambda key, scan: None, every_tick=True)
    logging.getLogger("counter").info("%s comes", sys.argv[1])
    node.run(lambda now: ticks.append(now // 100_000_000))
    print("saw all ticks to", ticks[-1], ticks == list(range(1, ticks[-1] + 1)))

logging.basicConfig(level="INFO", format="%(message)s")
zteam.run("counter", main)
"""
WITH_COUNTER = """
[team]
world = "arena"
[[robots]]
id = 0
behavior = "wander"
[[robots]]
id = 1
follow = "previous"
[[nodes]]
name = "counter"
command = ["python", "counter.py", "${who:-mine}"]
expect = true
"""


def up(folder: Path, *arguments: str) -> tuple[int, str, dict[str, Any]]:
    """Run `zteam up team.toml` with a report to its end: exit code, output, report."""
    done = subprocess.run(
        zteam_command("zteam", "up", "team.toml", "--report", "r.json", *arguments),
        cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=LIMIT, check=False,
    )  # fmt: skip
    report = folder / "r.json"
    return done.returncode, done.stdout, json.loads(report.read_text()) if report.exists() else {}


@pytest.mark.parametrize("options", [(), ("--in-process", "--bus")], ids=["processes", "in one process"])
def test_a_node_of_the_team_takes_part_from_start_to_end(tmp_path: Path, options: tuple[str, ...]) -> None:
    """It gets its argument, sees every tick of lock-step once, is asked to stop, and is in the report."""
    (tmp_path / "counter.py").write_text(COUNTER)
    (tmp_path / "team.toml").write_text(WITH_COUNTER)
    code, output, report = up(tmp_path, "who=yours", "--lockstep", "--for", "2", *options)
    assert code == 0, output
    assert "[counter] yours comes" in output
    assert f"[counter] saw all ticks to {report['ticks']} True" in output, output
    assert "counter" in report["rounds"]
    assert [(row["exit"], row["restarts"]) for row in report["processes"] if row["name"] == "counter"] == [(0, 0)]
    assert report["restarts"] == {}


SWARM = """
import zteam
from zteam.messages import Twist, Vector3

def main(node):
    wheels = [node.publisher(f"robot_{i}/cmd_vel", Twist) for i in range(2)]
    node.run(lambda now: [each.put(Twist(Vector3(0.5))) for each in wheels])

zteam.run("swarm", main)
"""
BLIND = (
    'define dot position ( size [0.3 0.3 0.3] )\ndot ( pose [0 0 0 0] name "r0" )\ndot ( pose [0 2 0 0] name "r1" )\n'
)


@pytest.mark.parametrize("robots", ["", '[[robots]]\nids = "0-1"\nbehavior = "none"\n'], ids=["no robots", "none"])
def test_one_program_drives_robots_without_lasers(tmp_path: Path, robots: str) -> None:
    """No process of the team stands between it and their wheels, and GO waits for none."""
    (tmp_path / "swarm.py").write_text(SWARM)
    (tmp_path / "blind.world").write_text(BLIND)
    node = '[[nodes]]\nname = "swarm"\ncommand = ["python", "swarm.py"]\nexpect = true\n'
    (tmp_path / "team.toml").write_text(f'[team]\nworld = "blind.world"\n{robots}{node}')
    code, output, report = up(tmp_path, "--lockstep", "--for", "2")
    assert code == 0, output
    assert [row["distance_m"] for row in report["robots"]] == pytest.approx([1.0, 1.0], abs=0.1)


FLAKY = """
import os, pathlib, signal, zteam
from zteam.messages import Twist, Vector3

def fail_once(name, number):
    mark = pathlib.Path(__file__).parent / name
    if not mark.exists():
        mark.touch()
        os.kill(os.getpid(), number)

class Flaky(zteam.Behavior):
    def step(self, view):
        fail_once("robot", signal.SIGKILL)
        return Twist(Vector3(0.2))

def main(node):
    fail_once("node", signal.SIGSEGV)
    print("the node works", flush=True)
    node.run(lambda now: None)

if __name__ == "__main__":
    zteam.run("flaky", main)
"""
WITH_FLAKY = """
[team]
world = "arena"
restart = "on-failure"
[[robots]]
id = 0
behavior = "flaky:Flaky"
[[robots]]
id = 1
behavior = "idle"
[[nodes]]
name = "flaky"
command = ["python", "flaky.py"]
"""


def up_until(team: TeamFixture, folder: Path, *told: str, options: Sequence[str] = ()) -> tuple[int, str, Any]:
    """As `up`, in lock-step for 4 s, of which almost all pass when these lines have come: exit code, output, report."""
    pace = ("--lockstep", "--speed", str(1.0 / LIMIT), "--for", "4", "--report", str(folder / "r.json"))
    name = team.spawn("zteam", "up", str(folder / "team.toml"), *pace, *options)
    for line in told:
        team.wait_for_line(name, line)
    team.sim.set_speed(None)
    code = team.wait_for_exit(name)
    return code, "\n".join(team.lines(name)), json.loads((folder / "r.json").read_text())


def test_what_fails_comes_back(team: TeamFixture, tmp_path: Path) -> None:
    """A killed robot drives again and a node works again; lines, report and its table count them and say how fast."""
    (tmp_path / "flaky.py").write_text(FLAKY)
    (tmp_path / "team.toml").write_text(WITH_FLAKY)
    code, output, report = up_until(
        team, tmp_path, "robot_0 is back after", "flaky is back after", "[flaky] the node works"
    )
    assert code == 0, output
    assert "robot_0 ended: killed by SIGKILL; it is started again in 0.1 s (1 of 5)" in output
    assert "flaky ended: killed by SIGSEGV; it is started again in 0.1 s (1 of 5)" in output
    assert re.search(
        r"started again: flaky 1 time \(back after [\d.]+ s\), robot_0 1 time \(back after [\d.]+ s\)", output
    )
    assert report["recovery_seconds"].keys() == report["restarts"].keys()
    assert report["restarts"] == {"flaky": 1, "robot_0": 1}
    rows = {row["name"]: (row["exit"], row["restarts"]) for row in report["processes"]}
    assert (rows["flaky"], rows["robot_0"], rows["robot_1"]) == ((0, 1), (0, 1), (0, 0))
    assert report["robots"][0]["distance_m"] > 0.02


RAISING = """
import pathlib, zteam
from zteam.messages import Twist, Vector3

class Raising(zteam.Behavior):
    def step(self, view):
        mark = pathlib.Path(__file__).parent / "mark"
        if not mark.exists():
            mark.touch()
            raise RuntimeError("the first of its kind")
        return Twist(Vector3(0.2))
"""


def test_a_robot_in_one_process_comes_back(team: TeamFixture, tmp_path: Path) -> None:
    """An error of its behaviour ends its node, which is started again and drives with a new behaviour."""
    (tmp_path / "raising.py").write_text(RAISING)
    text = '[team]\nworld = "arena"\n[[robots]]\nid = 0\nbehavior = "raising:Raising"\nrestart = "on-failure"\n'
    (tmp_path / "team.toml").write_text(text)
    options = ("--in-process", "--bus")
    code, output, report = up_until(team, tmp_path, "robot_0 is back after", options=options)
    assert code == 0, output
    assert "RuntimeError: the first of its kind" in output
    assert "robot_0 ended: exit code 1; it is started again in 0.1 s (1 of 5)" in output
    assert report["restarts"] == {"robot_0": 1}
    assert report["robots"][0]["distance_m"] > 0.02
