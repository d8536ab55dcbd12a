"""One child process: its output, its end, its memory, and what it inherits."""

import os
import shlex
import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from support.limits import LIMIT
from support.started_child import Started, has_ended
from support.transports import wait_until_true
from zteam.bus.options import RouterOptions
from zteam.node.kinds import ROUTER
from zteam.node.launcher import Page, Report
from zteam.node.process_options import to_line
from zteam.team.launch.plan import MEMBER
from zteam.team.launch.process import MAX_LINE, ProcessReport, exit_text, spawn, zteam_command

SLEEPER = "import subprocess, sys\np = subprocess.Popen([sys.executable, '-c', 'import time; time.sleep(600)'])\n"
"""Starts a process of its own."""


def run(code: str) -> Started:
    """A child that runs a Python text."""
    return Started(spawn, [sys.executable, "-S", "-c", code])


def test_lines_come_in_order_from_both_outputs() -> None:
    """Standard output and error are one stream of lines, all of which have come at the end; bytes that are not UTF-8
    are replaced."""
    code = (
        "import os\n"
        "os.write(1, b'one\\n'); os.write(2, b'two\\n'); os.write(1, b'\\xff three\\n'); os.write(1, b'no newline')"
    )
    child = run(f"{code}; raise SystemExit(7)")
    assert child.finish() == 7
    assert child.heard == ["one", "two", "� three", "no newline"]
    assert list(child.process.lines) == child.heard
    assert not child.process.running


def test_only_the_newest_lines_are_kept() -> None:
    """A process that writes for days does not fill the launcher's memory."""
    child = run("for i in range(5000): print(i)")
    assert child.finish() == 0
    assert len(child.heard) == 5000
    assert len(child.process.lines) < 1000
    assert child.process.lines[-1] == "4999"


def test_a_line_without_an_end_is_cut() -> None:
    """It is passed on when it is long enough, and says so; the next line is whole."""
    child = run(f"print('\\0' * {3 * MAX_LINE} + 'end\\nnext')")
    assert child.finish() == 0
    first, second = child.heard
    assert first.startswith("\0" * MAX_LINE) and "longer" in first and len(first) < 2 * MAX_LINE
    assert second == "next"


def test_a_line_without_an_end_comes_while_it_is_written() -> None:
    """A process that writes nothing else for ever is seen, and ends as others do."""
    child = run("import os\nwhile True: os.write(1, b'x' * 4096)")
    assert child.up.wait(LIMIT)
    assert child.heard[0].startswith("xxx")
    child.process.kill()
    assert child.finish() == -signal.SIGKILL


@pytest.mark.parametrize(
    ("code", "text"),
    [(None, "still running"), (0, "exit code 0"), (2, "exit code 2"), (-15, "killed by SIGTERM"), (-99, "signal 99")],
)
def test_exit_codes_have_words(code: int | None, text: str) -> None:
    """The text has the exit code or the signal, also for a signal without a name."""
    assert text in exit_text(code)


def test_a_child_inherits_its_link_and_nothing_else() -> None:
    """Besides its standard streams it has its end of the link alone: with the launcher's end it would never end, and
    with the stdin of an earlier child that child would not. Its group is its own: Ctrl+C does not reach it."""
    code = (
        "import os\n"
        "number = int(os.environ['ZTEAM_LAUNCHER_LINK'])\n"
        "os.fstat(number)\n"
        # listdir's own descriptor is closed again when the others are looked at.
        "open_ones = [n for n in os.listdir('/proc/self/fd') if os.path.exists(f'/proc/self/fd/{n}')]\n"
        "print(sorted({int(n) for n in open_ones} - {0, 1, 2, number}), os.getpgid(0) == os.getpid())"
    )
    first, child = run("input()"), run(code)
    child.finish()
    assert child.heard == ["[] True"]
    first.process.write_line("end")
    first.finish()


REPORTS = r"""
import os
from zteam.node.faults import log_fault
from zteam.node.launcher import LINK, Page, report
os.write(int(os.environ[LINK]), b'garbage\n\xff\n{"listening": 3}\n{"answer": ' + b"[" * 100_000 + b"\n")
report(listening="tcp/[::1]:1", page=Page(8766, "a b"))
log_fault(ValueError("two\nlines: \udcff"))
"""


def test_reports_come_as_fields() -> None:
    """Also those of what a user's script has started; what is no report is ignored."""
    child = Started(spawn, ["/bin/sh", "-c", f"{shlex.join([sys.executable, '-c', REPORTS])}; exit 3"])
    assert child.finish() == 3
    fault = "ValueError: two\nlines: \\udcff"
    assert child.process.report == Report(listening="tcp/[::1]:1", page=Page(8766, "a b"), fault=fault)
    assert child.process.fault == fault


@pytest.mark.ci
def test_the_end_of_the_link_stops_a_member() -> None:
    """As the launcher's end does."""
    router = Started(spawn, [*MEMBER])
    router.process.write_line(to_line(ROUTER, RouterOptions(("tcp/127.0.0.1:0",))))
    wait_until_true(lambda: router.process.report.listening.startswith("tcp/127.0.0.1:"))
    router.process._link.shutdown(socket.SHUT_RDWR)
    assert router.finish() == 0


def test_its_standard_input_takes_one_line() -> None:
    """And then the end of the input. Writing to a process that has ended is no error: `on_exit` reports the end."""
    child = run("import sys; print([line for line in sys.stdin])")
    assert not child.process.join(0.0)
    assert child.process.running and child.process.exit_code is None
    child.process.write_line("tcp/127.0.0.1:7447")
    assert child.finish() == 0
    assert child.heard == ["['tcp/127.0.0.1:7447\\n']"]
    ended = run("")
    assert ended.up.wait(LIMIT)
    ended.process.write_line("too late")
    assert ended.finish() == 0


@pytest.mark.skipif(not hasattr(os, "SCHED_BATCH"), reason="this system has no SCHED_BATCH")
def test_a_batch_process_is_one_with_the_threads_that_it_starts() -> None:
    """From before it reads its first line on."""
    code = (
        "import os, sys, threading\nsys.stdin.readline()\nfound = [os.sched_getscheduler(0)]\n"
        "other = threading.Thread(target=lambda: found.append(os.sched_getscheduler(0)))\n"
        "other.start(); other.join()\nprint([each == os.SCHED_BATCH for each in found])"
    )
    for batch in (False, True):
        child = Started(spawn, [sys.executable, "-S", "-c", code], batch=batch)
        child.process.write_line("go")
        assert child.finish() == 0
        assert child.heard == [str([batch] * 2)]


def test_killing_ends_what_it_started() -> None:
    """A kill ends the whole process group, grandchildren and frozen processes included."""
    child = run(f"{SLEEPER}print(p.pid, flush=True)\np.wait()")
    assert child.up.wait(LIMIT)
    handle = os.pidfd_open(int(child.heard[0]))
    child.process.signal(signal.SIGSTOP)
    child.process.kill()
    assert child.finish() == -signal.SIGKILL
    assert has_ended(handle)
    os.close(handle)


def test_an_end_is_reported_while_a_grandchild_lives() -> None:
    """Although its background process holds the output; that process is ended."""
    child = run(f"{SLEEPER}print('started', flush=True)\nraise SystemExit(3)")
    assert child.finish() == 3


@pytest.mark.ci
def test_an_end_is_reported_while_a_daemon_holds_the_output() -> None:
    """A process in a session of its own, which outlives the child, does not hide the child's end and exit code."""
    # It ends with the link, after the child.
    code = (
        "import os, subprocess, sys\n"
        "link = int(os.environ['ZTEAM_LAUNCHER_LINK'])\n"
        "wait = f'import os; os.read({link}, 1)'\n"
        "subprocess.Popen([sys.executable, '-c', wait], pass_fds=[link], start_new_session=True)\n"
        "print('left', flush=True)\n"
        "raise SystemExit(3)"
    )
    child = run(code)
    assert child.finish() == 3
    assert child.heard == ["left"]


def test_signals_after_the_end_are_not_sent() -> None:
    """The process id may belong to another process by then."""
    child = run("")
    child.finish()
    child.process.terminate()
    child.process.signal(signal.SIGKILL)
    assert child.process.exit_code == 0


def test_memory_is_the_peak() -> None:
    """60 MB that were used and freed still show in both figures; processor time is counted. An ended process keeps its
    figures."""
    code = (
        "import mmap\nm = mmap.mmap(-1, 60_000_000)\nm.write(b'x' * 60_000_000)\nprint('full', flush=True)\ninput()\n"
        "m.close()\nprint('empty', flush=True)\nimport time\ntime.sleep(600)"
    )
    child = run(code)
    process = child.process
    assert child.up.wait(LIMIT)
    child.up.clear()
    process.usage.measure()
    full = process.usage.pss_mb
    assert full > 60
    process.write_line("1")
    assert child.up.wait(LIMIT)
    now = ProcessReport("now", process.pid)
    now.measure()
    assert now.pss_mb < full - 50
    process.usage.measure()
    assert process.usage.pss_mb == full
    assert now.rss_mb > 60  # the kernel's own high-water mark
    assert process.usage.cpu_seconds > 0
    process.kill()
    child.finish()
    process.usage.measure()
    assert process.usage.pss_mb == full > 0.0


@pytest.mark.ci
def test_commands_ignore_modules_in_the_current_folder(tmp_path: Path) -> None:
    """A user's folder named zteam does not shadow the package."""
    (tmp_path / "zteam").mkdir()
    (tmp_path / "zteam" / "__init__.py").write_text("raise SystemExit('shadowed')")
    command = zteam_command("zteam", "--version")
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=LIMIT, check=False)
    assert done.stdout.startswith("zteam "), done.stderr
