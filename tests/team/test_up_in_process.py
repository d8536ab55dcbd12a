"""`zteam up --in-process` as a command."""

import json
import os
import pty
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from support.limits import LIMIT
from support.terminal import CONTROLLED
from zteam.team.launch.process import zteam_command

pytestmark = pytest.mark.team

HANG = 'print("hangs", flush=True)\n            while True: pass'
BEHAVIOR = """
from zteam import Behavior
from zteam.messages import Twist, Vector3

class Own(Behavior):
    def step(self, view):
        if view.now == 3_000_000_000:
            {line}
        return Twist(Vector3(0.1))
"""
TEAM = """
[team]
world = "arena"
[[robots]]
id = 0
behavior = "own_way:Own"
[[robots]]
id = 1
behavior = "forward"
speed = 0.1
"""


def up(*arguments: str, folder: Path) -> "subprocess.CompletedProcess[str]":
    """The command's result."""
    return subprocess.run(
        zteam_command("zteam", "up", *arguments), cwd=folder, capture_output=True, text=True, timeout=LIMIT,
        check=False, stdin=subprocess.DEVNULL,
    )  # fmt: skip


def write_team(folder: Path, line: str) -> None:
    """A team whose robot 0 executes this line at 3 s."""
    (folder / "own_way.py").write_text(BEHAVIOR.format(line=line))
    (folder / "team.toml").write_text(TEAM)


def test_the_run_and_its_report_are_those_of_processes(tmp_path: Path) -> None:
    """Both ways write the same figures of the world, and print the same lines of the robots. Until GO nothing is
    printed twice, and no hint that is meant for processes started by hand."""
    reports, lines = [], []
    for options in ((), ("--in-process",)):
        done = up("arena", "--lockstep", "--for", "10", "--report", "r.json", *options, folder=tmp_path)
        assert done.returncode == 0, done.stdout + done.stderr
        reports.append(json.loads((tmp_path / "r.json").read_text()))
        lines.append({line.partition(" ")[0] for line in done.stdout.splitlines() if line.startswith("[")})
        start = done.stdout.partition("[monitor] All robots GO!")[0].splitlines()
        told = sorted(line.split()[0] for line in start if line.startswith("[") and "driving" not in line)
        assert told == ["[monitor]", "[monitor]", "[robot_0]", "[robot_1]", "[sim]"], start
    for key in ("trajectory_sha256", "seed", "ticks", "sim_seconds", "robots", "external_commands"):
        assert reports[0][key] == reports[1][key], key
    assert reports[0]["dropped"] == reports[1]["dropped"] == {}
    assert sorted(reports[0]["rounds"]) == sorted(reports[1]["rounds"])
    assert [row["name"] for row in reports[1]["processes"]] == ["up"]
    assert lines[1] == lines[0] == {"[sim]", "[robot_0]", "[robot_1]", "[monitor]"}


@pytest.mark.real_time
def test_in_real_time_too(tmp_path: Path) -> None:
    """Without lock-step the team drives too, and takes the host's time."""
    done = up("arena", "--in-process", "--for", "2", "--report", "r.json", folder=tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    report = json.loads((tmp_path / "r.json").read_text())
    assert not report["lockstep"]
    assert report["wall_seconds"] >= 2.0
    assert report["robots"][0]["distance_m"] > 0.0


def test_it_ends_before_a_tick(tmp_path: Path) -> None:
    """`--until` ends the run after the tick before it, with a report, with processes too."""
    done = up("arena", "--until", "20", "--report", "r.json", "--lockstep", folder=tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    assert json.loads((tmp_path / "r.json").read_text())["ticks"] == 19
    assert "before tick 20: the world stands still" in done.stdout


def test_a_behaviour_can_be_debugged(tmp_path: Path) -> None:
    """`breakpoint()` opens the debugger on the terminal in the user's own frame; after `c` the run goes on to its end,
    and the result is the same as without the debugger."""
    hashes = []
    for line in ("pass", "breakpoint()"):
        write_team(tmp_path, line)
        master, slave = pty.openpty()
        command = zteam_command("zteam", "up", "team.toml", "--in-process", "--lockstep", "--for", "5")
        launcher = subprocess.Popen(
            [sys.executable, "-c", CONTROLLED, *command, "--report", "r.json"],
            cwd=tmp_path, stdin=slave, stdout=slave, stderr=slave, start_new_session=True,
            env={**os.environ, "TERM": "xterm"},
        )  # fmt: skip
        os.close(slave)
        output = ""
        try:
            if line != "pass":
                while "(Pdb)" not in output:
                    output += os.read(master, 4096).decode()
                assert "own_way.py(9)step()" in output
                os.write(master, b"p 'now ' + str(view.now)\nc\n")
            while chunk := _read(master):
                output += chunk
            assert launcher.wait(LIMIT) == 0, output
        finally:
            launcher.kill()
            launcher.wait()
            os.close(master)
        assert line == "pass" or "now 3000000000" in output
        hashes.append(json.loads((tmp_path / "r.json").read_text())["trajectory_sha256"])
    assert hashes[0] == hashes[1]


def _read(master: int) -> str:
    try:
        return os.read(master, 4096).decode(errors="replace")
    except OSError:
        # The other end is closed.
        return ""


@pytest.mark.parametrize("line", ["pass", HANG])
def test_ctrl_c_ends_it(tmp_path: Path, line: str) -> None:
    """SIGINT ends a run with an end as 130, and a behaviour that does not return after a short while by force."""
    write_team(tmp_path, line)
    launcher = subprocess.Popen(
        zteam_command("zteam", "up", "team.toml", "--in-process", "--lockstep", "--speed", "2", "--for", "1000"),
        cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
    )  # fmt: skip
    assert launcher.stdout is not None
    try:
        for told in launcher.stdout:
            if "All robots GO!" in told:
                break
        if line != "pass":
            for told in launcher.stdout:
                if "hangs" in told:
                    break
        launcher.send_signal(signal.SIGINT)
        output, _ = launcher.communicate(timeout=LIMIT)
    finally:
        launcher.kill()
        launcher.wait()
    assert launcher.returncode == (130 if line == "pass" else 1), output
