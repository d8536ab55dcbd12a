"""Recorded runs: what a recording proves, and that it is run again as it was."""

import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path

import pytest

from support.outside import send
from zteam import Recording
from zteam.clock import pause
from zteam.messages import String, Twist, Vector3
from zteam.robot.client import ParametersClient
from zteam.team.testing.team import TeamFixture

WITNESS = """
from zteam import Node
from zteam.messages import Message, String

class Said(Message):
    ros_type = "lab_msgs/msg/Said"
    words: list[str] = []

def main(node: Node) -> None:
    heard = []
    node.subscribe("chat", String, lambda key, message: heard.append(message.data))
    said = node.publisher(f"{node.name}/said", Said)

    def step(now: int) -> None:
        if heard:
            said.put(Said(list(heard)))
        heard.clear()

    node.run(step)
"""
RESTLESS = """
import time
from zteam import Behavior
from zteam.messages import Twist, Vector3

class Restless(Behavior):
    count = 0

    def step(self, view):
        self.count += 1
        return Twist(Vector3(0.1 + time.time() % 1e-3)) if self.count > 5 else Twist(Vector3(0.1))
"""


def zteam(*words: str | Path) -> "subprocess.CompletedProcess[str]":
    """Run a command in this folder to its end."""
    command = [sys.executable, "-m", "zteam", *map(str, words)]
    return subprocess.run(command, capture_output=True, text=True, timeout=200.0, check=False)


def drive_from_outside(team: TeamFixture) -> None:
    """Words, velocities, a parameter, a stop, a robot that is moved, and one that comes."""
    for number in range(3):
        team.run(0.5)
        send(team, "chat", String(f"word_{number}"))
        send(team, "robot_0/cmd_vel_teleop", Twist(Vector3(0.1), Vector3(z=0.5 + number)))
    team.run(1.0)
    ParametersClient(team.bus).set("robot_1", {"speed": 0.3})
    team.run(1.0)
    team.stop(robots=[1])
    team.run(0.5)
    team.release([1])
    team.sim.move(0, 0.5, 0.5, 1.0)
    team.run(1.0)
    team.sim.spawn(-1.0, -1.0)
    team.run(1.0)


def end_and_come_back(team: TeamFixture) -> None:
    """A robot's process is killed twice while the world runs as fast as it can, and started again."""

    def trouble() -> None:
        for _ in range(2):
            pause(0.2)
            team.kill("robot_1")
            pause(0.1)
            team.restart("robot_1")

    thread = threading.Thread(target=trouble)
    thread.start()
    while thread.is_alive():
        team.run(2.0)
    thread.join()
    team.wait_for_processes("robot_1")
    team.run(2.0)


@pytest.mark.gate
# A thread cannot be killed.
@pytest.mark.parametrize(
    ("act", "in_process"), [(drive_from_outside, False), (drive_from_outside, True), (end_and_come_back, False)]
)
def test_a_run_is_run_again(
    team: TeamFixture, empty_folder: Path, act: Callable[[TeamFixture], None], *, in_process: bool
) -> None:
    """Fed from its recorded ticks alone, in processes and in one process, it is the same in each tick and message."""
    (empty_folder / "witness.py").write_text(WITNESS)
    nodes = dict.fromkeys(("ann", "bob"), "witness:main")
    options = {"params": {0: {"speed": 0.1}}} if act is drive_from_outside else {"follow": {1: 0}}
    team.start("arena", robots=2, behavior="forward", nodes=nodes, in_process=in_process, record=True, **options)
    team.wait_for_go()
    act(team)
    trajectory, ticks, file = team.report.trajectory_sha256, team.tick, team.recording
    team.close()
    recording = Recording(file)
    report = recording.report
    assert (report.is_whole, report.gaps, report.stray) == (True, [], {})
    if act is drive_from_outside:
        # Of a type that only its node knows.
        assert [message.words for _, message in recording.messages("bob/said")] == [[f"word_{n}"] for n in range(3)]
    for words in ([], ["--in-process"]):
        again = zteam("rerun", file, *words)
        assert again.returncode == 0, again.stdout + again.stderr
        assert trajectory in again.stdout + again.stderr
        # The last one may not be over.
        assert f"{ticks - 1} ticks, the same" in again.stdout


def test_a_changed_team_differs_where_it_is_changed(empty_folder: Path) -> None:
    """`--team` gives the same inputs to another team: the first difference has tick, topic and field."""
    team = '[team]\nworld = "arena"\n[[robots]]\nid = 0\nbehavior = "forward"\nspeed = {}\n'
    for name, speed in (("slow.toml", 0.1), ("fast.toml", 0.2)):
        (empty_folder / name).write_text(team.format(speed))
    made = zteam("up", "slow.toml", "--lockstep", "--for", "2", "--in-process", "--record", "run.mcap")
    assert made.returncode == 0, made.stderr
    again = zteam("rerun", "run.mcap", "--in-process", "--team", "fast.toml")
    assert again.returncode == 1, again.stdout + again.stderr
    assert "tick 1: robot_0/done of robot_0: command.linear.x is 0.1 in A, 0.2 in B" in again.stdout


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["up", "--for", "1", "--record", "run.mcap"], "real time"),
        (["up", "--for", "1", "--lockstep", "--in-process"], "No such file"),
    ],
)
def test_what_cannot_be_run_again_is_refused(empty_folder: Path, words: list[str], reason: str) -> None:
    """With a line that has the reason, and exit code 2."""
    assert zteam(*words).returncode == 0
    again = zteam("rerun", "run.mcap")
    assert again.returncode == 2
    assert reason in again.stderr
    assert again.stderr.count("\n") == 1


def test_a_recorder_that_is_killed_stops_nobody_else(team: TeamFixture) -> None:
    """The team drives on, and what was recorded until then can be read."""
    team.start("arena", robots=1, record=True)
    team.wait_for_go()
    team.run(2.0)
    # It writes what has come at least once a second.
    topics = lambda: Recording(team.recording).topics  # noqa: E731
    team.wait_for(lambda: "robot_0/odom" in topics() and topics()["robot_0/odom"].messages >= 15)
    team.expect_end("recorder")
    team.kill("recorder")
    before = team.tick
    team.run(1.0)
    assert team.tick > before
    assert not Recording(team.recording).report.is_finished


def test_a_behavior_that_reads_the_clock_differs_at_its_command(empty_folder: Path) -> None:
    """The first difference is what it commands, in the tick in which it does so."""
    (empty_folder / "restless.py").write_text(RESTLESS)
    (empty_folder / "team.toml").write_text(
        '[team]\nworld = "arena"\n[[robots]]\nid = 1\nbehavior = "restless:Restless"\n'
    )
    made = zteam("up", "team.toml", "--lockstep", "--until", "9", "--record", "run.mcap", "--in-process")
    assert made.returncode == 0, made.stderr
    again = zteam("rerun", "run.mcap", "--in-process")
    assert again.returncode == 1, again.stdout + again.stderr
    assert "tick 6: robot_1/cmd_vel of robot_1: linear.x is " in again.stdout
