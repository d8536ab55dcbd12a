"""A forked child is like a spawned one; what a warm parent does with its orders."""

import json
import os
import signal
import socket
from contextlib import closing
from pathlib import Path

import pytest

from support.limits import LIMIT
from support.started_child import Started, has_ended, obey
from zteam.team.launch import fork_server
from zteam.team.launch.process import spawn, zteam_command
from zteam.team.launch.warm_parent import WarmParent, can_fork

pytestmark = [
    pytest.mark.gate,
    pytest.mark.skipif(not can_fork(), reason="no fork here, or ZTEAM_NO_FORK is set"),
]


FACTS = """
import gc, json, logging, os, signal, sys, threading
number = int(os.environ.pop("ZTEAM_LAUNCHER_LINK"))
os.fstat(number)
ignored = [int(s) for s in signal.valid_signals() if signal.getsignal(s) == signal.SIG_IGN]
print(json.dumps({
    "argv": sys.argv[1:], "path": sys.path, "flags": list(sys.flags), "cwd": os.getcwd(),
    "environment": dict(os.environ), "ignored": ignored, "group": os.getpgid(0) == os.getpid(),
    "interrupt": str(signal.getsignal(signal.SIGINT)), "blocked": len(signal.pthread_sigmask(signal.SIG_BLOCK, [])),
    "open": sorted(int(n) for n in os.listdir("/proc/self/fd") if os.path.exists(f"/proc/self/fd/{n}")
                   and int(n) != number),
    "threads": threading.active_count(), "thread": threading.current_thread() is threading.main_thread(),
    "handlers": len(logging.getLogger().handlers), "level": logging.getLogger().level, "gc": gc.isenabled(),
    "streams": [(s.encoding, s.errors, s.line_buffering, s.seekable(), s.isatty())
                for s in (sys.stdin, sys.stdout, sys.stderr)], "warnings": sys.warnoptions,
}))
"""


def test_a_forked_child_is_like_a_spawned_one(
    warm: WarmParent, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Arguments, environment, folder, signals, descriptors, streams and the interpreter's state are the same.

    So they are where the launcher has changed its folder and variables after its warm parent started.
    """
    warm.prepare()
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("ZTEAM_NAMESPACE", "changed")
    facts = []
    for start in (spawn, warm.start):
        child = Started(start, obey(FACTS, "x", "a b", "ü"), ZTEAM_CONNECT="tcp/1.2.3.4:5")
        assert child.finish() == 0, child.heard
        facts.append(json.loads(child.heard[-1]))
    spawned, forked = facts
    assert forked == spawned
    assert forked["cwd"] == str(tmp_path)
    assert forked["environment"]["ZTEAM_NAMESPACE"] == "changed"
    assert forked["environment"]["ZTEAM_CONNECT"] == "tcp/1.2.3.4:5"


@pytest.mark.ci
def test_a_child_whose_folder_is_gone_leaves_the_warm_parent_alive(
    warm: WarmParent, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It runs in the folder that is gone, as a spawned one would; the next one runs too."""
    assert Started(warm.start, obey("pass")).finish() == 0
    pids = warm.pids
    with monkeypatch.context() as there:
        gone = tmp_path / "gone"
        gone.mkdir()
        there.chdir(gone)
        gone.rmdir()
        assert Started(warm.start, obey("pass")).finish() == 0
    assert Started(warm.start, obey("pass")).finish() == 0
    assert warm.pids == pids


@pytest.mark.few(1)
@pytest.mark.parametrize(
    ("code", "expected"),
    [
        ("raise SystemExit(7)", 7),
        ("pass", 0),
        ("1 / 0", 1),
        ("import os, signal; os.kill(os.getpid(), signal.SIGKILL)", -9),
        ("import os, signal; os.kill(os.getpid(), signal.SIGTERM)", -15),
        ("import os, signal; os.kill(os.getpid(), signal.SIGINT)", -2),
        ("import os; os._exit(3)", 3),
    ],
)
def test_exit_codes_are_those_of_a_spawned_child(warm: WarmParent, code: str, expected: int) -> None:
    """However it ends, its exit code is the same in both ways; a signal is negative."""
    children = [Started(start, obey(code)) for start in (spawn, warm.start)]
    assert [child.finish() for child in children] == [expected, expected]


def test_exit_hooks_run_and_the_last_words_arrive(warm: WarmParent) -> None:
    """The interpreter ends as usual: hooks, threads that are no daemons, and the buffers of its streams."""
    code = (
        "import atexit, threading, sys\n"
        "atexit.register(lambda: print(' hook'))\n"
        "threading.Thread(target=lambda: print(' thread')).start()\n"
        # Between spaces: the thread may be between its text and its line break.
        "sys.stderr.write(' last words ')"
    )
    child = Started(warm.start, obey(code))
    assert child.finish() == 0
    assert sorted(" ".join(child.heard).split()) == ["hook", "last", "thread", "words"]


def test_it_can_be_written_to_signalled_and_killed(warm: WarmParent) -> None:
    """Standard input, SIGTERM to the child, and SIGKILL to its group with a grandchild."""
    reading = Started(warm.start, obey("print(input()[::-1])"))
    reading.process.write_line("abc")
    assert (reading.finish(), reading.heard) == (0, ["cba"])

    waiting = "print('up', flush=True); import signal; signal.pause()"
    asked = Started(warm.start, obey(waiting))
    assert asked.up.wait(LIMIT)
    assert asked.process.running
    assert asked.process.exit_code is None
    asked.process.terminate()
    assert asked.finish() == -signal.SIGTERM

    inner = "import os, signal; print(os.getpid(), flush=True); signal.pause()"
    nested = f"import subprocess, sys; subprocess.Popen([sys.executable, '-c', {inner!r}]).wait()"
    killed = Started(warm.start, obey(nested))
    assert killed.up.wait(LIMIT)
    grandchild = os.pidfd_open(int(killed.heard[0]))
    killed.process.kill()
    assert killed.finish() == -signal.SIGKILL
    assert has_ended(grandchild)
    os.close(grandchild)


@pytest.mark.ci
def test_children_draw_different_random_numbers(warm: WarmParent, monkeypatch: pytest.MonkeyPatch) -> None:
    """Python's and numpy's generators without a seed are not copies of the warm parent's."""
    code = "import random, numpy.random; print(random.random(), numpy.random.random())"
    children = [Started(warm.start, obey(code)) for _ in range(2)]
    assert [child.finish() for child in children] == [0, 0]
    first, second = (child.heard[0].split() for child in children)
    assert first[0] != second[0]
    assert first[1] != second[1]


@pytest.mark.ci
def test_the_modules_of_a_team_are_there(warm: WarmParent) -> None:
    """All modules that are to be preloaded exist, and none that a robot must not import is among them."""
    code = (
        "import sys\n"
        "from zteam.team.launch.fork_server import PRELOADS\n"
        "print([name for name in PRELOADS if name not in sys.modules])\n"
        "print([name for name in ('pymunk', 'rich', 'yaml') if name in sys.modules])"
    )
    child = Started(warm.start, obey(code))
    assert (child.finish(), child.heard) == (0, ["[]", "[]"])


@pytest.mark.ci
def test_ps_shows_each_process_under_its_commands_name() -> None:
    """Forked and spawned processes have the name that an installed command would have."""

    def shown(pid: int) -> str:
        return Path(f"/proc/{pid}/comm").read_text().strip()

    command = zteam_command("zteam-router", "--listen", "tcp/127.0.0.1:0", "--announce")
    with closing(WarmParent()) as warm:
        for start in (spawn, warm.start):
            router = Started(start, command)
            assert router.up.wait(LIMIT)
            assert shown(router.process.pid) == "zteam-router"
            router.process.terminate()
            assert router.finish() == 0
        assert shown(*warm.pids.values()) == "zteam-parent"


@pytest.mark.ci
@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("--id", "x"), 2),
        (("--id", "1", "--follow", "1"), 2),
        (("--help",), 0),
        (("--id", "0", "--behavior", "no_such"), 2),
    ],
)
def test_a_forked_robot_says_the_same(warm: WarmParent, words: tuple[str, ...], expected: int) -> None:
    """A mistake is said once, by the child, with the exit code of a spawned one; the next child is started as usual."""
    children = [Started(start, zteam_command("zteam-robot", *words)) for start in (spawn, warm.start)]
    assert [child.finish() for child in children] == [expected, expected]
    spawned, forked = (child.heard for child in children)
    assert spawned
    assert forked == spawned
    (pid,) = warm.pids.values()
    assert Started(warm.start, obey("pass")).finish() == 0
    assert list(warm.pids.values()) == [pid]


def test_a_forked_robot_sees_its_own_environment(warm: WarmParent) -> None:
    """Options that the environment gives are those of the child, not of the warm parent or of another child."""
    command = zteam_command("zteam-robot", "--id", "0")
    assert Started(warm.start, command, ZTEAM_LEASE="nonsense").finish() == 2
    bad = Started(warm.start, command, ZTEAM_CONNECT="nonsense")
    bad.finish()
    assert any("nonsense" in line for line in bad.heard), bad.heard


def test_a_launcher_that_is_gone_ends_it() -> None:
    """It also ends where an order was not read."""
    launcher, parent = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with parent:
        launcher.close()
        assert fork_server.serve(parent) is None
