"""Ctrl+C at chosen moments of a command: at an import, or at the call or return of a function."""

import os
import subprocess
import sys

import pytest

from zteam.testing.team import START_LIMIT, TeamFixture

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


def run(team: TeamFixture, start: str, event: str, name: str, words: str) -> "subprocess.CompletedProcess[str]":
    """Run an entry point and interrupt it at the given event."""
    return subprocess.run(
        [sys.executable, "-c", HARNESS, start, event, name, *words.split()],
        env={**os.environ, **team.environment},
        capture_output=True,
        text=True,
        timeout=START_LIMIT,
        check=False,
    )


@pytest.mark.parametrize(
    ("start", "event", "name", "words"),
    [
        ("start", "import", "zteam.cli.topic", "topic list"),
        ("start", "import", "msgspec", "topic list"),
        ("start", "import", "zenoh", "topic list"),
        ("start", "import", "numpy", "topic list"),
        ("start", "call", "zteam.cli.topic.build_parser", "topic list"),
        ("start", "call", "zteam.bus.connection.connect", "topic list"),
        ("start", "return", "zteam.bus.options.open_session", "topic list"),
        ("start", "call", "zteam.cli.listening.survey", "topic list"),
        ("start", "call", "zteam.bus.session.close", "topic list"),
        ("start", "return", "zteam.bus.session.close", "topic list"),
        ("start", "return", "zteam.cli.listening.open_bus", "node list"),
        ("start", "call", "zteam.cli.doctor._team", "doctor"),
        ("start", "call", "zteam.services.simulator_client._ask", "sim status"),
        ("start", "call", "zteam.cli.tf_displays.show_tree", "tf tree"),
        ("start", "import", "zteam.world", "world check arena"),
        ("start", "import", "zteam.launch.run", "up"),
        ("start_simulator", "import", "zteam.simulation_options", "arena"),
        ("start_robot", "import", "zteam.behaviors", "--id 0"),
        ("start_aggregator", "import", "zteam.nodes.transforms.node", ""),
        ("start_robot", "call", f"zteam.cli.zteam_robot._drive>{_LOCK_GONE}", "--id 0"),
        ("start_simulator", "call", f"zteam.cli.zteam_sim._simulate>{_LOCK_GONE}", "arena"),
        ("start_monitor", "import", "zteam.nodes.monitor.node", "--team-size 1"),
        ("start_router", "import", "zteam.nodes.router.node", ""),
    ],
)
def test_an_interrupt_ends_a_command_quietly(team: TeamFixture, start: str, event: str, name: str, words: str) -> None:
    """The command ends with exit code 130 and without a traceback."""
    done = run(team, start, event, name, words)
    assert done.returncode == 130, done.stderr
    assert done.stderr == ""


def test_an_interrupt_while_handlers_are_installed_is_not_lost(team: TeamFixture) -> None:
    """The process ends in order: before it has opened a session, silently; after that, with its last line."""
    done = run(team, "start_robot", "return", "zteam.runtime.shutdown.install>signal.signal", "--id 0")
    assert done.returncode == 0
    assert [line.endswith("robot_0 stopped") for line in done.stderr.splitlines()] in ([], [True]), done.stderr


def test_an_interrupt_after_the_work_changes_nothing(team: TeamFixture) -> None:
    """A command that has done its work keeps its exit code and its output."""
    done = run(team, "start", "return", "zteam.cli.main._start", "world check arena")
    assert (done.returncode, done.stderr) == (0, "")
    assert "2 robots" in done.stdout
