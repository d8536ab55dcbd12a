"""Ctrl+C at chosen moments of a command: at an import, or at the call or return of a function."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from support.limits import LIMIT
from zteam import names
from zteam.team.launch.process import zteam_command
from zteam.team.testing.team import TeamFixture

pytestmark = pytest.mark.team

HARNESS = """
import os, signal, sys
start, event, name, *words = sys.argv[1:]
sys.argv = [start, *words]
*before, name = name.split(">")

def interrupt():
    sys.setprofile(None)
    sys.meta_path[:] = [finder for finder in sys.meta_path if not isinstance(finder, Importing)]
    os.kill(os.getpid(), signal.SIGINT)

class Importing:
    def find_spec(self, module, path=None, target=None):
        if event == "import" and module == name:
            interrupt()

def profile(frame, what, _argument):
    place = f"{frame.f_globals.get('__name__')}.{frame.f_code.co_name}"
    if before:
        if what == "call" and place == before[0]:
            before.pop(0)
    elif what == event and place == name:
        interrupt()

sys.meta_path.insert(0, Importing())
sys.setprofile(profile)
import zteam.cli.main
sys.exit(getattr(zteam.cli.main, start)())
"""
"""Runs an entry point and sends the signal when it imports a module, or at the call or return of a function.
With `first>then`, at the function `then` after a call of `first`."""
_LOCK_GONE = "importlib._bootstrap.cb"
"""A callback of the import system, where Python prints an exception and goes on."""


@pytest.fixture(scope="module")
def router() -> Iterator[dict[str, str]]:
    """The environment of commands at a router without a team."""
    team = TeamFixture()
    yield team.environment
    team.close()


def run(router: dict[str, str], start: str, event: str, name: str, words: str) -> "subprocess.CompletedProcess[str]":
    """Run an entry point and interrupt it at the given event."""
    return subprocess.run(
        [sys.executable, "-c", HARNESS, start, event, name, *words.split()],
        env={**os.environ, **router},
        capture_output=True,
        text=True,
        timeout=LIMIT,
        check=False,
    )


@pytest.mark.parametrize(
    ("start", "event", "name", "words"),
    [
        ("start", "import", "zteam.cli.topic", "topic list"),
        ("start", "import", "zenoh", "topic list"),
        ("start", "import", "numpy", "topic list"),
        ("start", "call", "zteam.bus.connection.connect", "topic list"),
        ("start", "return", "zteam.bus.options.open_session", "topic list"),
        ("start", "call", "zteam.bus.zenoh_session.close", "topic list"),
        ("start", "return", "zteam.bus.zenoh_session.close", "topic list"),
        ("start", "call", "zteam.monitor.doctor.collecting.collect_facts", "doctor"),
        ("start", "call", "zteam.simulator.client._ask", "sim status"),
        ("start", "import", "zteam.simulator.world", "world check arena"),
        ("start", "import", "zteam.team.run.team_run", "up"),
        ("start_simulator", "import", "zteam.config.simulation_options", "arena"),
        ("start_robot", "import", "zteam.robot.behaviors", "--id 0"),
        ("start_robot", "call", f"zteam.cli.processes.be>{_LOCK_GONE}", "--id 0"),
        ("start_router", "import", "zteam.node.router", ""),
    ],
)
def test_an_interrupt_ends_a_command_quietly(
    router: dict[str, str], start: str, event: str, name: str, words: str
) -> None:
    """The command ends with exit code 130 and without a traceback."""
    done = run(router, start, event, name, words)
    assert done.returncode == 130, done.stderr
    assert done.stderr == ""


def test_an_interrupt_while_handlers_are_installed_is_not_lost(router: dict[str, str]) -> None:
    """The process ends in order: before it has opened a session, silently; after that, with its last line."""
    done = run(router, "start_robot", "return", "zteam.node.shutdown.install>signal.signal", "--id 0")
    assert done.returncode == 0
    assert [line.endswith("robot_0 stopped") for line in done.stderr.splitlines()[-1:]] in ([], [True]), done.stderr


def test_an_interrupt_after_the_work_changes_nothing(router: dict[str, str]) -> None:
    """A command that has done its work keeps its exit code and its output."""
    done = run(router, "start", "return", "zteam.cli.main.start_command", "world check arena")
    assert (done.returncode, done.stderr) == (0, "")
    assert "2 robots" in done.stdout


ENDS = {
    "zteam-sim arena": 0,
    "zteam-tf": 0,
    "zteam-monitor --team-size 2": 0,
    "zteam-robot --id 0 --no-gate": 0,
    "zteam-nav --id 1": 0,
    "zteam-view --port 0": 0,
    "zteam tf static 0 0 0 0 0 0 robot_0/base_link robot_0/mast": 0,
    "zteam tf echo robot_0/base_link robot_0/mast": 130,
    "zteam topic echo robot_0/odom": 130,
    "zteam topic pub -r 5 robot_1/cmd_vel Twist {}": 130,
    "zteam log": 130,
    "zteam goto 0 1 1": 130,
}
"""Commands of a user who starts a team by hand, the simulator first, and the exit code that the page of tools gives."""


def test_the_exit_code_after_ctrl_c_is_that_of_the_page(team: TeamFixture, tmp_path: Path) -> None:
    """What runs until Ctrl+C ends with 0, and a tool with 130."""
    processes = [names.SIMULATOR, names.AGGREGATOR, names.MONITOR, "robot_0", "nav_1"]
    environment = {**os.environ, **team.environment, "PYTHONUNBUFFERED": "1"}
    running: dict[str, subprocess.Popen[bytes]] = {}
    said = {command: tmp_path / str(number) for number, command in enumerate(ENDS)}
    tells = [command for command, code in ENDS.items() if code or "view" in command]
    try:
        for command, path in said.items():
            with path.open("w") as file:
                words = zteam_command(*command.split())
                running[command] = subprocess.Popen(words, env=environment, stdout=file, stderr=file)
        team.wait_for_processes(*processes)
        team.wait_for(lambda: all(said[command].stat().st_size for command in tells))
        team.wait_for(lambda: "Translation:" in said["zteam tf echo robot_0/base_link robot_0/mast"].read_text())
        team.expect_end(*processes)
        for process in reversed(running.values()):
            process.send_signal(signal.SIGINT)
            process.wait(LIMIT)
    finally:
        for process in running.values():
            process.kill()
            process.wait()
    assert {command: process.returncode for command, process in running.items()} == ENDS
