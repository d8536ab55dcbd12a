"""What a warm parent forks, and what it cannot; nothing of it outlives the launcher; without it all still works."""

import errno
import os
import resource
import signal
import subprocess
import sys
import threading
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from support.limits import LIMIT
from support.started_child import Started, has_ended, obey
from zteam.team.launch import process, warm_parent
from zteam.team.launch.process import Child, zteam_command
from zteam.team.launch.warm_parent import UNKNOWN, ForkedChild, WarmParent, can_fork

pytestmark = pytest.mark.skipif(not can_fork(), reason="no fork here, or ZTEAM_NO_FORK is set")


def kind_of(warm: WarmParent, command: list[str], **environment: str) -> type[Child]:
    """The kind of the child, which is ended at once."""
    child = Started(warm.start, command, **environment)
    child.process.kill()
    child.finish()
    return type(child.process._child)


def test_what_cannot_be_forked_is_spawned(monkeypatch: pytest.MonkeyPatch) -> None:
    """Foreign commands, variables that modules read when they are imported, the wish of the user, and measuring tools
    that begin with the interpreter."""
    help_text = zteam_command("zteam-router", "--help")
    with closing(WarmParent()) as warm:
        assert kind_of(warm, help_text) is ForkedChild
        assert kind_of(warm, help_text, ZTEAM_LEASE="3") is ForkedChild
        assert kind_of(warm, [sys.executable, "-c", "pass"]) is not ForkedChild
        assert kind_of(warm, ["true"]) is not ForkedChild
        assert kind_of(warm, help_text, OMP_NUM_THREADS="1") is not ForkedChild
        for name in ("ZTEAM_NO_FORK", "COVERAGE_PROCESS_START"):
            with monkeypatch.context() as changed:
                changed.setenv(name, "1")
                assert kind_of(warm, help_text) is not ForkedChild
        assert kind_of(warm, help_text) is ForkedChild


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
def test_a_warm_parent_without_descriptors_says_so(warm: WarmParent, monkeypatch: pytest.MonkeyPatch) -> None:
    """The streams of a child that it cannot take do not make a child without streams."""
    before = resource.getrlimit(resource.RLIMIT_NOFILE)
    warm.prepare()
    (pid,) = warm.pids.values()
    assert kind_of(warm, obey("pass")) is ForkedChild
    resource.prlimit(pid, resource.RLIMIT_NOFILE, (5, before[1]))
    assert kind_of(warm, obey("pass")) is not ForkedChild
    resource.prlimit(pid, resource.RLIMIT_NOFILE, before)
    assert kind_of(warm, obey("pass")) is ForkedChild


@pytest.mark.ci
def test_a_child_is_waited_for_without_a_free_descriptor(warm: WarmParent, monkeypatch: pytest.MonkeyPatch) -> None:
    """A launcher that may open no further file learns its exit code all the same."""

    def refuse(_descriptor: int) -> int:
        raise OSError(errno.EMFILE, os.strerror(errno.EMFILE))

    monkeypatch.setattr(warm_parent.os, "dup", refuse)
    assert Started(warm.start, obey("raise SystemExit(7)")).finish() == 7


def test_nothing_is_left_when_it_is_closed(warm: WarmParent) -> None:
    """No process, no zombie and no descriptor."""
    before = sorted(Path("/proc/self/fd").iterdir())
    for _ in range(3):
        assert Started(warm.start, obey("print(1)")).finish() == 0
    (pid,) = warm.pids.values()
    warm.close()
    assert not Path(f"/proc/{pid}").exists()
    assert sorted(Path("/proc/self/fd").iterdir()) == before


@pytest.mark.ci
def test_it_ends_with_a_launcher_that_is_killed(tmp_path: Path) -> None:
    """A launcher that gets SIGKILL leaves neither its warm parent nor the children that hold its links."""
    code = (
        "import os, signal\n"
        "from zteam.team.launch.process import zteam_command\n"
        "from zteam.team.launch.supervisor import Supervisor\n"
        "from zteam.team.launch.warm_parent import WarmParent\n"
        "warm = WarmParent()\n"
        "supervisor = Supervisor(lambda *_: None, lambda _: None, warm.start)\n"
        "router = supervisor.start('r', zteam_command('zteam-router', '--listen', 'tcp/127.0.0.1:0', '--announce'))\n"
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


def test_a_failing_fork_is_told_and_the_child_spawned(warm: WarmParent, monkeypatch: pytest.MonkeyPatch) -> None:
    """A request that does not fit into a message does not harm the warm parent."""
    warm.prepare()
    first = warm.pids
    long: dict[str, Any] = {"ZTEAM_LONG": "x" * 120_000, "ZTEAM_LONGER": "x" * 120_000}
    assert kind_of(warm, obey("pass"), **long) is not ForkedChild
    assert kind_of(warm, obey("pass")) is ForkedChild
    assert warm.pids == first


@pytest.mark.ci
def test_many_threads_start_one_warm_parent(warm: WarmParent) -> None:
    """The first children of a team come from threads at the same time; one process forks them all."""
    parents: list[dict[str, int]] = []

    def begin() -> None:
        child = Started(warm.start, obey("pass"))
        parents.append(warm.pids)
        assert child.finish() == 0

    threads = [threading.Thread(target=begin) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(LIMIT)
    assert len(parents) == 4
    assert all(found == parents[0] for found in parents)


@pytest.mark.ci
def test_without_what_linux_alone_has_children_are_spawned(warm: WarmParent, monkeypatch: pytest.MonkeyPatch) -> None:
    """A system without process descriptors, waitid and /proc: a child is spawned, ends and has its exit code."""
    monkeypatch.delattr(os, "pidfd_open")
    monkeypatch.delattr(os, "waitid")
    monkeypatch.setattr(process, "PROC", Path("/nowhere"))
    child = Started(warm.start, obey("print(input())"))
    assert not isinstance(child.process._child, ForkedChild)
    child.process.measure()
    child.process.write_line("heard")
    assert (child.finish(), child.heard) == (0, ["heard"])
    assert child.process.usage == process.Usage()
