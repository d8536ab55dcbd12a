"""Faults on purpose, with real processes."""

import json
import socket
import subprocess
from pathlib import Path

import pytest

from support.limits import LIMIT
from support.pairs import PAIR
from zteam import names
from zteam.bus import NoRequest
from zteam.config.fault import Fault
from zteam.node.kinds import ROUTER
from zteam.team.chaos.means import plan_text
from zteam.team.launch.process import zteam_command
from zteam.team.testing.team import TeamFixture

pytestmark = pytest.mark.team

PLAN = (
    Fault(at=1.0, fault="pause", name="robot_1", seconds=1.0),
    Fault(at=3.0, fault="cut", name="robot_0", seconds=0.5),
    Fault(at=4.5, fault="slow", name="robot_1", seconds=1.0, delay=0.25),
)


def run_in(folder: Path, *options: str) -> str:
    """The hash of seven seconds of `team.toml` in lock-step; whatever the plan, no robot moves on without commands."""
    words = ("team.toml", "--lockstep", "--for", "7", "--report", "run.json", *options)
    done = subprocess.run(
        zteam_command("zteam", "up", *words), cwd=folder, capture_output=True, text=True, timeout=LIMIT,
        check=False, stdin=subprocess.DEVNULL,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    assert ("no robot moved longer than the watchdog allows" in done.stdout) == ("--chaos" in options)
    report = json.loads((folder / "run.json").read_text())
    assert report["hung"] == []
    return str(report["trajectory_sha256"])


def test_a_plan_of_lock_step_is_the_same_run_with_processes(tmp_path: Path) -> None:
    """One process each and all in one process give the same trajectory under the same faults, and exit code 0."""
    (tmp_path / "team.toml").write_text(PAIR)
    (tmp_path / "plan.toml").write_text(plan_text(PLAN))
    assert run_in(tmp_path, "--chaos", "plan.toml") == run_in(tmp_path, "--chaos", "plan.toml", "--in-process")


def test_a_killed_router_changes_no_run_of_lock_step(tmp_path: Path) -> None:
    """The world waits for the next router, and all take part as before: the trajectory is that without faults."""
    (tmp_path / "team.toml").write_text(PAIR.replace("[team]", '[team]\nrestart = "on-failure"'))
    (tmp_path / "plan.toml").write_text(plan_text([Fault(at=at, fault="kill", name=ROUTER) for at in (2.0, 4.0)]))
    assert run_in(tmp_path, "--chaos", "plan.toml", "--lockstep-timeout", "60") == run_in(tmp_path, "--in-process")


@pytest.mark.real_time
def test_a_team_recovers_from_each_fault(team: TeamFixture, tmp_path: Path) -> None:
    """A killed robot is started again, and a frozen, cut or slow one drives on; no robot moves on without commands."""
    (tmp_path / "team.toml").write_text(PAIR)
    team.launch(tmp_path / "team.toml", lockstep=False, chaos=True)
    team.wait_for_go()
    team.until(lambda: team.robot(0).speed > 0.1 and team.robot(1).speed > 0.1, within=30)
    for outcome in (
        team.chaos.cut("robot_1", seconds=1.0),
        team.chaos.slow("robot_0", seconds=1.0, delay=1.6),
        team.chaos.pause("tf", seconds=1.0),
        team.chaos.kill("robot_1"),
    ):
        assert outcome.recovery is not None and not outcome.problem


@pytest.mark.real_time
def test_the_command_does_it_to_a_running_team(team: TeamFixture, tmp_path: Path) -> None:
    """`zteam chaos` has a process paused and reports, also the router; a link can be cut only where there is one. What
    a stranger answers in a robot's name changes nothing."""
    team.start("office", robots=2, follow={1: 0}, lockstep=False)
    team.wait_for_go()
    # No system has a process of this id: to signal it would be an error.
    forged = {"name": "robot_1", "host": socket.gethostname(), "pid": 2**22 + 1, "start": 1, "instance": "0"}
    team.bus.serve(names.info_key("robot_1"), NoRequest, lambda _: forged)
    for name in ("robot_1", "router"):
        done = team.command("chaos", "pause", name, "--for", "0.5", "--json")
        assert done.returncode == 0, done.stderr
        report = json.loads(done.stdout)
        assert [row["name"] for row in report["faults"]] == [name] and report["faults"][0]["recovery"] >= 0.0
        assert report["violations"] == []
    done = team.command("chaos", "kill", "robot_7")
    assert done.returncode == 1 and "runs no process robot_7: if robot_7 was started by hand" in done.stderr
    done = team.command("chaos", "cut", "robot_1")
    assert done.returncode == 1 and "start the team with 'zteam up --chaos'" in done.stdout + done.stderr
    printed = team.command("chaos", "--random", "5", "--for", "60", "--print")
    assert printed.returncode == 0 and printed.stdout.count("[[faults]]") > 3


def test_in_lock_step_a_robot_is_left_out_of_the_ticks(team: TeamFixture) -> None:
    """The fixture's faults of a robot take simulated time: the same ticks, and the same trajectory, in each run."""
    team.start("office", robots=2, follow={1: 0}, seed=3)
    team.wait_for_go()
    team.run(3)
    runs = []
    for _ in range(2):
        team.sim.reset()
        team.run(3)
        outcome = team.chaos.pause("robot_1", seconds=1.0)
        assert team.tick > 40 and outcome.stood_after in (0.2, 0.3)
        team.run(2)
        runs.append((team.tick, outcome.recovery_sim, team.report.trajectory_sha256))
    assert runs[0] == runs[1]
