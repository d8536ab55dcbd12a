"""A forked child is like a spawned one; what cannot be forked is spawned; nothing outlives the launcher."""

import json
import os
import resource
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from support.limits import LIMIT
from support.started_child import Started, has_ended, obey
from zteam.team.launch import fork_server, process, warm_parent
from zteam.team.launch.process import Child, spawn, zteam_command
from zteam.team.launch.warm_parent import UNKNOWN, ForkedChild, WarmParent, can_fork

pytestmark = [
    pytest.mark.gate,
    pytest.mark.skipif(not can_fork(), reason="no fork here, or ZTEAM_NO_FORK is set"),
]
TESTS = Path(__file__).parents[3]


@pytest.fixture
def warm(monkeypatch: pytest.MonkeyPatch) -> Iterator[WarmParent]:
    """A warm parent that also forks the obedient child of these tests."""
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(filter(None, [str(TESTS), os.environ.get("PYTHONPATH")])))
    monkeypatch.setattr(warm_parent, "runs_zteam", lambda _command: True)
    with closing(WarmParent()) as parent:
        yield parent


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


HOOKS = (
    "import atexit, threading, sys\n"
    "atexit.register(lambda: print(' hook'))\n"
    "threading.Thread(target=lambda: print(' thread')).start()\n"
    # Between spaces: the thread may be between its text and its line break.
    "sys.stderr.write(' last words ')"
)


@pytest.mark.few(1)
@pytest.mark.parametrize(
    ("code", "expected"),
    [
        ("raise SystemExit(7)", 7),
        ("1 / 0", 1),
        ("import os, signal; os.kill(os.getpid(), signal.SIGKILL)", -9),
        ("import os, signal; os.kill(os.getpid(), signal.SIGINT)", -2),
        (HOOKS, 0),
    ],
)
def test_a_forked_child_ends_as_a_spawned_one(warm: WarmParent, code: str, expected: int) -> None:
    """Its exit code is the same, negative for a signal; hooks and threads that are no daemons run, and all that they
    write arrives."""
    children = [Started(start, obey(code)) for start in (spawn, warm.start)]
    assert [child.finish() for child in children] == [expected, expected]
    if code == HOOKS:
        assert sorted(" ".join(children[1].heard).split()) == ["hook", "last", "thread", "words"]


def test_it_can_be_written_to_signalled_and_killed(warm: WarmParent) -> None:
    """Standard input, SIGTERM to the child, and SIGKILL to its group with a grandchild."""
    reading = Started(warm.start, obey("print(input()[::-1])"))
    reading.process.write_line("abc")
    assert (reading.finish(), reading.heard) == (0, ["cba"])

    asked = Started(warm.start, obey("print('up', flush=True); import signal; signal.pause()"))
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
def test_children_draw_different_random_numbers(warm: WarmParent) -> None:
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
        "print([name for name in ('pymunk', 'yaml') if name in sys.modules])"
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


def test_a_forked_robot_sees_its_own_environment(warm: WarmParent) -> None:
    """Options that the environment gives are those of the child, not of the warm parent or of another child. A mistake
    is said once, as by a spawned child."""
    command = zteam_command("zteam-robot", "--id", "0")
    assert Started(warm.start, command, ZTEAM_LEASE="nonsense").finish() == 2
    wrong = [Started(start, command, ZTEAM_CONNECT="nonsense") for start in (spawn, warm.start)]
    assert [child.finish() for child in wrong] == [2, 2]
    assert wrong[0].heard == wrong[1].heard != []


def test_a_launcher_that_is_gone_ends_it() -> None:
    """It also ends where an order was not read."""
    launcher, parent = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with parent:
        launcher.close()
        assert fork_server.serve(parent) is None


def kind_of(warm: WarmParent, command: list[str], **environment: str) -> type[Child]:
    """The kind of the child, which is ended at once."""
    child = Started(warm.start, command, **environment)
    child.process.kill()
    child.finish()
    return type(child.process._child)


def test_what_cannot_be_forked_is_spawned(monkeypatch: pytest.MonkeyPatch) -> None:
    """Foreign commands, variables that modules read when they are imported, the wish of the user, measuring tools that
    begin with the interpreter, and a request that does not fit into a message. The warm parent stays the same."""
    help_text = zteam_command("zteam-router", "--help")
    with closing(WarmParent()) as warm:
        assert kind_of(warm, help_text) is ForkedChild
        pids = warm.pids
        assert kind_of(warm, help_text, ZTEAM_LEASE="3") is ForkedChild
        assert kind_of(warm, ["true"]) is not ForkedChild
        assert kind_of(warm, help_text, OMP_NUM_THREADS="1") is not ForkedChild
        assert kind_of(warm, help_text, ZTEAM_LONG="x" * 120_000, ZTEAM_LONGER="x" * 120_000) is not ForkedChild
        for name in ("ZTEAM_NO_FORK", "COVERAGE_PROCESS_START"):
            with monkeypatch.context() as changed:
                changed.setenv(name, "1")
                assert kind_of(warm, help_text) is not ForkedChild
        assert kind_of(warm, help_text) is ForkedChild
        assert warm.pids == pids


@pytest.mark.ci
def test_another_environment_gets_another_warm_parent(warm: WarmParent, monkeypatch: pytest.MonkeyPatch) -> None:
    """What modules read when they are imported is as the launcher's environment says now. While children of the old
    one run, further ones are spawned."""
    waiting = Started(warm.start, obey("input()"))
    first = warm.pids
    monkeypatch.setenv("STAGEPATH", "/elsewhere")
    assert kind_of(warm, obey("pass")) is not ForkedChild
    waiting.process.write_line("")
    assert waiting.finish() == 0
    assert kind_of(warm, obey("pass")) is ForkedChild
    assert warm.pids != first


@pytest.mark.ci
def test_a_dead_warm_parent_is_replaced(warm: WarmParent) -> None:
    """Its children go on and can be ended; only their exit codes are lost. The next ones have a new warm parent."""
    orphan = Started(warm.start, obey("print('up', flush=True); input()"))
    assert orphan.up.wait(LIMIT)
    (pid,) = warm.pids.values()
    handle = os.pidfd_open(pid)
    os.kill(pid, signal.SIGKILL)
    assert has_ended(handle)
    os.close(handle)
    assert orphan.process.running
    assert kind_of(warm, obey("pass")) is ForkedChild
    orphan.process.write_line("")
    assert orphan.finish() == UNKNOWN


@pytest.mark.ci
def test_a_warm_parent_that_does_not_answer_is_left_alone(warm: WarmParent, monkeypatch: pytest.MonkeyPatch) -> None:
    """It stands still: the next child is spawned after a while, and the one after that has a new warm parent."""
    monkeypatch.setattr(warm_parent, "_PATIENCE", 0.3)
    warm.prepare()
    (pid,) = warm.pids.values()
    os.kill(pid, signal.SIGSTOP)
    assert kind_of(warm, obey("pass")) is not ForkedChild
    monkeypatch.setattr(warm_parent, "_PATIENCE", LIMIT)
    assert kind_of(warm, obey("pass")) is ForkedChild
    assert pid not in warm.pids.values()


def test_a_child_that_cannot_be_watched_does_not_run_beside_the_next(
    warm: WarmParent, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Where the launcher has no descriptor left for a forked child, that one is killed before another is spawned."""
    warm.prepare()
    gate = tmp_path / "gate"
    os.mkfifo(gate)
    opened: list[int] = []
    open_pidfd = os.pidfd_open

    def refuse(pid: int, flags: int = 0) -> int:
        if pid == os.getpid():
            return open_pidfd(pid, flags)
        opened.append(open_pidfd(pid, flags))
        raise OSError(24, "Too many open files")

    monkeypatch.setattr(os, "pidfd_open", refuse)
    assert kind_of(warm, obey(f"open({str(gate)!r}).read()")) is not ForkedChild
    (forked,) = opened
    assert has_ended(forked)
    os.close(forked)


@pytest.mark.ci
def test_a_warm_parent_without_descriptors_says_so(warm: WarmParent) -> None:
    """The streams of a child that it cannot take do not make a child without streams."""
    before = resource.getrlimit(resource.RLIMIT_NOFILE)
    warm.prepare()
    (pid,) = warm.pids.values()
    assert kind_of(warm, obey("pass")) is ForkedChild
    resource.prlimit(pid, resource.RLIMIT_NOFILE, (5, before[1]))
    assert kind_of(warm, obey("pass")) is not ForkedChild
    resource.prlimit(pid, resource.RLIMIT_NOFILE, before)
    assert kind_of(warm, obey("pass")) is ForkedChild


def test_nothing_is_left_when_it_is_closed(warm: WarmParent) -> None:
    """No process, no zombie and no descriptor; children that start at the same time have one warm parent."""
    before = sorted(Path("/proc/self/fd").iterdir())
    codes, parents = list[int | None](), list[dict[str, int]]()

    def begin() -> None:
        child = Started(warm.start, obey("print(1)"))
        parents.append(warm.pids)
        codes.append(child.finish())

    threads = [threading.Thread(target=begin) for _ in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(LIMIT)
    (pid,) = warm.pids.values()
    assert (codes, parents) == ([0] * 3, [warm.pids] * 3)
    warm.close()
    assert not Path(f"/proc/{pid}").exists()
    assert sorted(Path("/proc/self/fd").iterdir()) == before


@pytest.mark.ci
def test_it_ends_with_a_launcher_that_is_killed() -> None:
    """A launcher that gets SIGKILL leaves neither its warm parent nor the children that hold its links."""
    code = (
        "import os, signal\n"
        "from zteam.team.launch.process import Job, zteam_command\n"
        "from zteam.team.launch.supervisor import Supervisor\n"
        "from zteam.team.launch.warm_parent import WarmParent\n"
        "warm = WarmParent()\n"
        "supervisor = Supervisor(lambda *_: None, warm.start)\n"
        "command = zteam_command('zteam-router', '--listen', 'tcp/127.0.0.1:0', '--announce')\n"
        "router = supervisor.start_job('r', Job(command))\n"
        "supervisor.wait(lambda: bool(router.lines), 30)\n"
        "print(*warm.pids.values(), router.pid, flush=True)\n"
        "signal.pause()"
    )
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True) as launcher:
        assert launcher.stdout is not None
        handles = [os.pidfd_open(int(word)) for word in launcher.stdout.readline().split()]
        launcher.kill()
    assert len(handles) == 2
    assert all(map(has_ended, handles))
    for handle in handles:
        os.close(handle)


@pytest.mark.ci
def test_without_what_linux_alone_has_children_are_spawned(warm: WarmParent, monkeypatch: pytest.MonkeyPatch) -> None:
    """A system without process descriptors, waitid and /proc: a child is spawned, ends and has its exit code."""
    monkeypatch.delattr(os, "pidfd_open")
    monkeypatch.delattr(os, "waitid")
    monkeypatch.setattr(process, "PROC", Path("/nowhere"))
    child = Started(warm.start, obey("print(input())"))
    assert not isinstance(child.process._child, ForkedChild)
    child.process.usage.measure()
    child.process.write_line("heard")
    assert (child.finish(), child.heard) == (0, ["heard"])
    assert child.process.usage == process.ProcessReport("child", child.process.pid)
