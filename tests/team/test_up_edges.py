"""`zteam up` beside a team fixture: the fixture's router and namespace show what the launcher's team does.

So no test here takes the machine's default port.
"""

import json
import os
import pty
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import zenoh

from zteam import names
from zteam.bus.options import BusOptions, client_config
from zteam.bus.presence import ProcessInfo
from zteam.launch.process import zteam_command
from zteam.messages import Twist, Vector3, encode
from zteam.testing.team import TeamFixture

pytestmark = pytest.mark.team

LIMIT = 60.0


def command(team: TeamFixture, *arguments: str) -> list[str]:
    """`zteam up` on the fixture's router."""
    return zteam_command("zteam", "up", *arguments, "--connect", team.endpoint, "--namespace", team.namespace)


def launch(team: TeamFixture, *arguments: str, **options: Any) -> "subprocess.Popen[str]":
    """`zteam up` running beside the test."""
    return subprocess.Popen(
        command(team, *arguments), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, **options
    )


def finish(launcher: "subprocess.Popen[str]") -> tuple[int, str]:
    """Exit code and output of a launcher that is about to end; one that is not is ended."""
    try:
        output, _ = launcher.communicate(timeout=LIMIT)
    finally:
        launcher.kill()
        launcher.wait()
    return launcher.returncode, output


def pid_of(team: TeamFixture, name: str) -> int:
    """Process id of a process of the team, by its own word."""
    return team.bus.ask(names.info_key(name), ProcessInfo).pid


@pytest.fixture
def outsider(team: TeamFixture) -> Iterator[zenoh.Session]:
    """A plain Zenoh client outside the team's namespace."""
    session = zenoh.open(client_config(BusOptions(connect=team.endpoint)))
    yield session
    session.close()  # type: ignore[no-untyped-call]


def test_a_given_router_is_used(team: TeamFixture, outsider: zenoh.Session, tmp_path: Path) -> None:
    """With --connect no router is started, the team is in the namespace, and the report tells of what outsiders did:
    commands that were none are dropped, those that were are external; seed and world come from the command line."""
    path = tmp_path / "r.json"
    team_file = tmp_path / "team.toml"
    team_file.write_text(
        '[team]\nworld = "office"\nseed = 1\n[[robots]]\nid = 0\nbehavior = "forward"\nspeed = 0.0\n'
        '[[robots]]\nid = 1\nbehavior = "forward"\nspeed = 0.0\n'
    )
    options = ("--world", "arena", "--seed", "9", "--for", "3", "--report", str(path))
    launcher = launch(team, str(team_file), *options)
    team.wait_for_go()
    go = team.now
    team.until(lambda: team.now > go + 0.5, within=5)
    for _ in range(3):
        outsider.put(f"{team.namespace}/robot_0/cmd_vel", b"no Twist")
    outsider.put(f"{team.namespace}/robot_1/cmd_vel", encode(Twist(Vector3(0.0), Vector3(0.0, 0.0, 0.1))))
    code, output = finish(launcher)
    assert code == 0, output
    report = json.loads(path.read_text())
    assert {row["name"] for row in report["processes"]} == {"sim", "tf", "monitor", "robot_0", "robot_1", "up"}
    assert report["seed"] == 9
    assert report["external_commands"] == 1
    # The fixture listens too, but only the processes' own counters are in the report.
    assert report["dropped"] == {"robot_0/cmd_vel": 3}
    assert [robot["id"] for robot in report["robots"]] == [0, 1]
    assert report["sim_seconds"] == pytest.approx(3.0, abs=0.11)
    assert team.robot(0).pose.x == pytest.approx(report["robots"][0]["pose"][0])


def test_a_dead_robot_is_told_and_the_others_go_on(team: TeamFixture) -> None:
    """Nothing is restarted silently: the launcher names robot and signal, and ends with 1 when it is stopped."""
    launcher = launch(team, "arena")
    try:
        team.wait_for_go()
        victim = pid_of(team, "robot_1")
        os.kill(victim, signal.SIGKILL)
        team.until(lambda: team.status is not None and 1 in team.status.lost, within=5)
        commands = team.robot(0).commands
        team.until(lambda: team.robot(0).commands > commands + 5, within=5)
        assert not team.alive("robot_1")
    finally:
        launcher.send_signal(signal.SIGINT)
        code, output = finish(launcher)
    assert "robot_1 ended: killed by SIGKILL" in output
    assert code == 1, output


CONTROLLED = "import fcntl, os, sys, termios\nfcntl.ioctl(0, termios.TIOCSCTTY, 0)\nos.execv(sys.argv[1], sys.argv[1:])"
"""Makes its standard input its controlling terminal, as a shell's is, and becomes the command."""


def test_ctrl_c_on_a_terminal_stops_in_order(team: TeamFixture) -> None:
    """Typed on a real terminal: the launcher alone hears it, every robot's last word is a zero velocity."""
    master, slave = pty.openpty()
    environment = {key: value for key, value in os.environ.items() if key != "NO_COLOR"}
    launcher = subprocess.Popen(
        [sys.executable, "-c", CONTROLLED, *command(team, "arena")],
        stdin=slave,
        stdout=slave,
        stderr=slave,
        env=environment,
        start_new_session=True,
    )
    os.close(slave)
    try:
        team.wait_for_go()
        team.until(lambda: team.robot(0).speed > 0.05 and all(team.robot(i).commands > 5 for i in (0, 1)), within=20)
        os.write(master, b"\x03")
        output = read_all(master)
        code = launcher.wait(LIMIT)
    finally:
        launcher.kill()
        launcher.wait()
        os.close(master)
    assert code == 0, output
    team.wait_for(lambda: all(team.robot(i).command == Twist() for i in (0, 1)))
    assert "did not stop" not in output
    lines = output.splitlines()
    stopped = [i for i, line in enumerate(lines) if "stopped" in line]
    assert len(stopped) >= 2, output
    assert any(line.startswith("\033[") and "[robot_0]\033[0m " in line for line in lines), "no colours"


def read_all(descriptor: int) -> str:
    """What a terminal shows until its last user has gone."""
    parts = []
    while True:
        try:
            part = os.read(descriptor, 65536)
        except OSError:
            # Linux says EIO instead of an end of file.
            break
        if not part:
            break
        parts.append(part)
    return b"".join(parts).decode(errors="replace")


def test_a_second_ctrl_c_does_not_wait(team: TeamFixture) -> None:
    """A robot that does not answer is killed as soon as the user asks again, and nothing is left."""
    launcher = launch(team, "arena")
    try:
        team.wait_for_go()
        frozen = pid_of(team, "robot_0")
        os.kill(frozen, signal.SIGSTOP)
        launcher.send_signal(signal.SIGINT)
        # The other robot's end shows that the stop is under way and waits for the frozen one.
        team.until(lambda: not team.alive("robot_1"), within=10)
        launcher.send_signal(signal.SIGINT)
    finally:
        code, output = finish(launcher)
    assert code == 0, output
    assert not Path("/proc", str(frozen)).exists()


STOPPER = """
import msgspec
from zteam.behaviors import Behavior
from zteam.messages import Twist, Vector3

class Slow(Behavior):
    class Params(msgspec.Struct, forbid_unknown_fields=True):
        speed: float

    def step(self, view):
        return Twist(Vector3(self.params.speed))
"""


def test_a_behaviour_beside_the_team_file_drives(team: TeamFixture, tmp_path: Path) -> None:
    """Wherever the command is typed, the check and the robot find the module."""
    (tmp_path / "my_slow_robot.py").write_text(STOPPER)
    team_file = tmp_path / "team.toml"
    table = '[[robots]]\nid = 0\nbehavior = "my_slow_robot:Slow"\nspeed = 0.125\n'
    team_file.write_text('[team]\nworld = "arena"\n' + table)
    launcher = launch(team, str(team_file), "--for", "1", cwd="/")
    try:
        team.wait_for_go()
        team.until(lambda: team.robot(0).command == Twist(Vector3(0.125)), within=20)
    finally:
        code, output = finish(launcher)
    assert code == 0, output


@pytest.mark.parametrize("redirection", [">/dev/full", ">&-"])
def test_output_that_cannot_be_written_is_told_and_the_team_goes_on(team: TeamFixture, redirection: str) -> None:
    """A full disk, or no standard output at all: one line about it, and the run ends as it should."""
    words = " ".join(command(team, "arena", "--for", "0.5"))
    done = subprocess.run(
        ["bash", "-c", f"{words} {redirection}"], stderr=subprocess.PIPE, text=True, timeout=LIMIT, check=False
    )
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr
    told = [line for line in done.stderr.splitlines() if "cannot write to standard output" in line]
    assert len(told) == 1 and told[0].endswith("; going on without it")


def test_a_second_team_is_one_line(team: TeamFixture) -> None:
    """On the router and in the namespace of a team that runs, a second one says whose place it is, and nothing else."""
    first = launch(team, "arena")
    try:
        team.wait_for_go()
        second = subprocess.run(command(team, "line"), capture_output=True, text=True, timeout=LIMIT, check=False)
        assert second.returncode == 1
        assert second.stdout == ""
        (line,) = second.stderr.splitlines()
        assert line.startswith(f"up: a team is already running here (pid {first.pid}, since ")
        assert line.endswith("); stop it, or use --namespace")
        assert team.alive("robot_1")
    finally:
        first.send_signal(signal.SIGINT)
        code, output = finish(first)
    assert code == 0, output


def test_output_that_nobody_reads_is_no_disaster(team: TeamFixture) -> None:
    """`zteam up | head -1`: no traceback, and the team ends as it should."""
    launcher = subprocess.Popen(
        command(team, "arena", "--for", "1"), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert launcher.stdout is not None
    launcher.stdout.readline()
    launcher.stdout.close()
    launcher.stdout = None
    try:
        _, errors = launcher.communicate(timeout=LIMIT)
    finally:
        launcher.kill()
        launcher.wait()
    assert "Traceback" not in errors
