"""`zteam up` on the router and in the namespace of a team fixture, through which the test observes its team.

No test here uses the machine's default port.
"""

import json
import os
import signal
import subprocess
from pathlib import Path
from typing import Any

import pytest
import zenoh

from support.limits import LIMIT
from zteam import names
from zteam.bus.presence import ProcessInfo
from zteam.bus.receiving import KeyCount
from zteam.messages import Twist, Vector3, encode
from zteam.team.launch.process import zteam_command
from zteam.team.launch.warm_parent import can_fork
from zteam.team.testing.team import TeamFixture

pytestmark = [pytest.mark.team, pytest.mark.real_time]


def command(team: TeamFixture, *arguments: str) -> list[str]:
    """`zteam up` on the fixture's router."""
    return zteam_command("zteam", "up", *arguments, "--connect", team.endpoint, "--namespace", team.namespace)


def launch(team: TeamFixture, *arguments: str, **options: Any) -> "subprocess.Popen[str]":
    """`zteam up` as a child process."""
    return subprocess.Popen(
        command(team, *arguments), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, **options
    )


def finish(launcher: "subprocess.Popen[str]") -> tuple[int, str]:
    """Exit code and output of a launcher; it is killed if it does not end within LIMIT."""
    try:
        output, _ = launcher.communicate(timeout=LIMIT)
    finally:
        launcher.kill()
        launcher.wait()
    return launcher.returncode, output


def pid_of(team: TeamFixture, name: str) -> int:
    """Process id of a process of the team, from its answer on the bus."""
    return team.bus.ask(names.info_key(name), ProcessInfo).pid


def test_a_given_router_is_used(team: TeamFixture, outsider: zenoh.Session, tmp_path: Path) -> None:
    """With --connect no router is started and the team is in the namespace; seed and world come from the command line;
    the report counts an outsider's bad messages as dropped, and its commands as external."""
    path = tmp_path / "r.json"
    team_file = tmp_path / "team.toml"
    team_file.write_text(
        '[team]\nworld = "office"\nseed = 1\n[[robots]]\nid = 0\nbehavior = "forward"\nspeed = 0.0\n'
        '[[robots]]\nid = 1\nbehavior = "forward"\nspeed = 0.0\n'
    )
    # All of it passes when the outsider's messages have come.
    pace = ("--lockstep", "--speed", str(1.0 / LIMIT))
    options = ("--world", "arena", "--seed", "9", *pace, "--for", "3", "--report", str(path))
    launcher = launch(team, str(team_file), *options)
    team.wait_for_go()
    team.wait_for(lambda: team.report.ticks > 0)
    for _ in range(3):
        outsider.put(f"{team.namespace}/robot_0/cmd_vel", b"no Twist")
    outsider.put(f"{team.namespace}/robot_1/cmd_vel", encode(Twist(Vector3(0.0), Vector3(0.0, 0.0, 0.1))))

    def all_came() -> bool:
        counts = team.bus.ask(names.stats_key(names.SIMULATOR), dict[str, KeyCount])
        return counts.get("robot_0/cmd_vel", KeyCount()).dropped == 3 and team.report.external_commands == 1

    team.wait_for(all_came)
    team.sim.set_speed(None)
    code, output = finish(launcher)
    assert code == 0, output
    report = json.loads(path.read_text())
    parent = {"warm_parent"} if can_fork() else set()
    present = {row["name"] for row in report["processes"]}
    assert present == {"sim", "tf", "monitor", "robot_0", "robot_1", "up"} | parent
    assert report["seed"] == 9
    assert report["external_commands"] == 1
    # The fixture listens too, but only the processes' own counters are in the report.
    assert report["dropped"] == {"robot_0/cmd_vel": 3}
    assert [robot["id"] for robot in report["robots"]] == [0, 1]
    assert report["sim_seconds"] == pytest.approx(3.0)
    assert team.robot(0).pose.x == pytest.approx(report["robots"][0]["pose"][0])


def test_a_second_ctrl_c_does_not_wait(team: TeamFixture) -> None:
    """The second Ctrl+C kills a robot that does not stop, and no process is left."""
    launcher = launch(team, "arena")
    try:
        team.wait_for_go()
        frozen = pid_of(team, "robot_0")
        os.kill(frozen, signal.SIGSTOP)
        launcher.send_signal(signal.SIGINT)
        # The end of the other robot shows that the launcher is stopping and waits for the frozen one.
        team.wait_for(lambda: not team.alive("robot_1"))
        launcher.send_signal(signal.SIGINT)
    finally:
        code, output = finish(launcher)
    assert code == 0, output
    assert not Path("/proc", str(frozen)).exists()


@pytest.mark.parametrize(("redirection", "lines"), [(">/dev/full", 1), (">&-", 1), ("| head -1", 0)])
def test_a_team_goes_on_without_its_output(team: TeamFixture, redirection: str, lines: int) -> None:
    """A full disk or a closed output is one line on standard error, a reader that is gone none; the run ends with 0."""
    words = " ".join(command(team, "arena", "--for", "0.5"))
    done = subprocess.run(
        ["bash", "-c", f"{words} {redirection}"], stderr=subprocess.PIPE, text=True, timeout=LIMIT, check=False
    )
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr
    told = [line for line in done.stderr.splitlines() if "cannot write to standard output" in line]
    assert len(told) == lines and all(line.endswith("; going on without it") for line in told)
