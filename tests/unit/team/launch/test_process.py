"""One child process: its output, its end, its memory, and what it inherits."""

import os
import shlex
import signal
import socket
import sys
import threading
import tracemalloc
from pathlib import Path

import pytest

from support.limits import LIMIT
from support.started_child import Started
from zteam.bus.options import RouterOptions
from zteam.node.kinds import ROUTER
from zteam.node.launcher import Page, Report
from zteam.node.process_options import to_line
from zteam.team.launch.plan import MEMBER
from zteam.team.launch.process import MAX_LINE, Process, Usage, exit_text, measure_usage, spawn, zteam_command


class Child:
    """A Process that runs a Python text, and records its callbacks."""

    def __init__(self, code: str) -> None:
        self.heard: list[str] = []
        self.ended = threading.Event()
        self.process = Process(
            "child",
            [sys.executable, "-c", code],
            on_line=lambda _process, line: self.heard.append(line),
            on_exit=lambda _process: self.ended.set(),
        )

    def finish(self) -> int | None:
        """Wait for its end; its exit code."""
        assert self.process.join(LIMIT)
        return self.process.exit_code


def test_lines_come_in_order_from_both_outputs() -> None:
    """Standard output and error are one stream of lines; bytes that are not UTF-8 are replaced."""
    code = (
        "import os\n"
        "os.write(1, b'one\\n'); os.write(2, b'two\\n'); os.write(1, b'\\xff three\\n'); os.write(1, b'no newline')"
    )
    child = Child(code)
    assert child.finish() == 0
    assert child.heard == ["one", "two", "� three", "no newline"]
    assert list(child.process.lines) == child.heard


def test_only_the_newest_lines_are_kept() -> None:
    """A process that writes for days does not fill the launcher's memory."""
    child = Child("for i in range(5000): print(i)")
    assert child.finish() == 0
    assert len(child.heard) == 5000
    assert len(child.process.lines) < 1000
    assert child.process.lines[-1] == "4999"


@pytest.mark.parametrize("written", [MAX_LINE, 64 * 2**20])
def test_a_line_without_an_end_is_cut(written: int) -> None:
    """It is passed on when it is long enough, says so, and takes no memory beyond that; the next line is whole."""
    code = f"import sys\nfor _ in range({written} >> 14): sys.stdout.write('\\0' * {MAX_LINE})\nprint('\\nnext')"
    tracemalloc.start()
    child = Child(code)
    assert child.finish() == 0
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert child.heard == ["\0" * MAX_LINE + "… (the line is longer)", "next"]
    assert peak < 2**21


def test_a_line_without_an_end_comes_while_it_is_written() -> None:
    """A process that writes nothing else for ever is seen, and ends as others do."""
    child = Child("import os\nwhile True: os.write(1, b'x' * 4096)")
    while not child.heard:
        assert not child.ended.wait(0.01)
    assert child.heard[0].startswith("xxx")
    child.process.kill()
    assert child.finish() == -signal.SIGKILL


def test_the_end_is_reported_after_the_last_line() -> None:
    """on_exit is called after on_line has got all lines, and the exit code is known then."""
    child = Child("print('last words'); raise SystemExit(7)")
    assert child.ended.wait(LIMIT)
    assert child.heard == ["last words"]
    assert child.process.exit_code == 7
    assert not child.process.running
    assert child.finish() == 7


def test_a_signal_is_a_negative_exit_code() -> None:
    """As in subprocess; `exit_text` names the signal."""
    child = Child("import os, signal; os.kill(os.getpid(), signal.SIGKILL)")
    assert child.finish() == -signal.SIGKILL
    assert exit_text(child.process.exit_code) == "killed by SIGKILL"


@pytest.mark.parametrize(
    ("code", "text"),
    [(None, "still running"), (0, "exit code 0"), (2, "exit code 2"), (-15, "killed by SIGTERM"), (-99, "signal 99")],
)
def test_exit_codes_have_words(code: int | None, text: str) -> None:
    """The text has the exit code or the signal, also for a signal without a name."""
    assert text in exit_text(code)


def test_the_child_has_a_group_of_its_own() -> None:
    """The terminal's Ctrl+C, sent to the launcher's group, does not reach it."""
    child = Child("import os; print(os.getpgid(0) == os.getpid())")
    child.finish()
    assert child.heard == ["True"]


def test_the_link_is_inherited_and_nothing_else() -> None:
    """Besides its standard streams, a child has its end of the link alone: with the launcher's end it would never end,
    and with the stdin of an earlier child that child would not."""
    code = (
        "import os\n"
        "number = int(os.environ['ZTEAM_LAUNCHER_LINK'])\n"
        "os.fstat(number)\n"
        # listdir's own descriptor is closed again when the others are looked at.
        "open_ones = [n for n in os.listdir('/proc/self/fd') if os.path.exists(f'/proc/self/fd/{n}')]\n"
        "print(sorted({int(n) for n in open_ones} - {0, 1, 2, number}))"
    )
    first = Child("input()")
    child = Child(code)
    child.finish()
    assert child.heard == ["[]"]
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


@pytest.mark.ci
def test_the_end_of_the_link_stops_a_member() -> None:
    """As the launcher's end does."""
    ready = threading.Event()
    router = Process(
        ROUTER, MEMBER, on_line=lambda *_: None, on_report=lambda *_: ready.set(), on_exit=lambda _: ready.set()
    )
    router.write_line(to_line(ROUTER, RouterOptions(("tcp/127.0.0.1:0",))))
    assert ready.wait(LIMIT)
    assert router.report.listening.startswith("tcp/127.0.0.1:")
    router._link.shutdown(socket.SHUT_RDWR)
    assert router.join(LIMIT)
    assert router.exit_code == 0


def test_a_line_reaches_its_standard_input() -> None:
    """write_line hands over one line and then the end of the input."""
    child = Child("import sys; print([line for line in sys.stdin])")
    child.process.write_line("tcp/127.0.0.1:7447")
    child.finish()
    assert child.heard == ["['tcp/127.0.0.1:7447\\n']"]


def test_writing_to_an_ended_process_is_no_error() -> None:
    """on_exit reports the end; the broken pipe raises nothing."""
    child = Child("")
    assert child.ended.wait(LIMIT)
    child.process.write_line("too late")
    assert child.finish() == 0


def test_joining_does_not_wait_longer_than_asked() -> None:
    """join returns False for a process that still runs, and can be called again."""
    child = Child("input()")
    assert not child.process.join(0.0)
    assert child.process.running
    assert child.process.exit_code is None
    child.process.write_line("end")
    assert child.finish() == 0


def test_killing_ends_what_it_started() -> None:
    """A kill ends the whole process group, grandchildren included."""
    code = (
        "import subprocess, sys\n"
        "p = subprocess.Popen([sys.executable, '-c', 'import time; time.sleep(600)'])\n"
        "print(p.pid, flush=True)\n"
        "p.wait()"
    )
    told = threading.Event()
    heard: list[str] = []

    def take(_process: Process, line: str) -> None:
        heard.append(line)
        told.set()

    process = Process("parent", [sys.executable, "-c", code], on_line=take, on_exit=lambda _process: told.set())
    assert told.wait(LIMIT)
    handle = os.pidfd_open(int(heard[0]))
    process.kill()
    # The grandchild held the output too, so the reader's end says that both are gone.
    assert process.join(LIMIT)
    os.close(handle)
    assert process.exit_code == -signal.SIGKILL


def test_a_frozen_process_can_be_killed() -> None:
    """SIGKILL ends a process that SIGSTOP has stopped."""
    child = Child("input()")
    child.process.signal(signal.SIGSTOP)
    child.process.kill()
    assert child.finish() == -signal.SIGKILL


def test_signals_after_the_end_are_not_sent() -> None:
    """The process id may belong to another process by then."""
    child = Child("")
    child.finish()
    child.process.terminate()
    child.process.signal(signal.SIGKILL)
    child.process.measure()
    assert child.process.exit_code == 0


def test_memory_is_the_peak() -> None:
    """60 MB that were used and freed still show in both figures; processor time is counted."""
    code = (
        "import mmap\nm = mmap.mmap(-1, 60_000_000)\nm.write(b'x' * 60_000_000)\nprint('full', flush=True)\ninput()\n"
    )
    code += "m.close()\nprint('empty', flush=True)\ninput()"
    told = threading.Semaphore(0)
    process = Process(
        "big",
        [sys.executable, "-c", code],
        on_line=lambda *_: told.release(),
        on_exit=lambda _process: told.release(),
    )
    try:
        assert told.acquire(timeout=LIMIT)
        process.measure()
        full = process.usage.pss_mb
        assert full > 60
        process.write_line("1", last=False)
        assert told.acquire(timeout=LIMIT)
        now = Usage()
        measure_usage(process.pid, now)
        assert now.pss_mb < full - 50
        process.measure()
        assert process.usage.pss_mb == full
        assert now.rss_mb > 60  # the kernel's own high-water mark
        assert process.usage.cpu_seconds > 0
    finally:
        process.kill()
        assert process.join(LIMIT)


def test_an_ended_process_keeps_its_figures() -> None:
    """The report still has the figures from before the end."""
    child = Child("input()")
    child.process.measure()
    before = child.process.usage.rss_mb
    assert before > 0
    child.process.write_line("end")
    child.finish()
    child.process.measure()
    assert child.process.usage.rss_mb == before
    gone = Usage()
    measure_usage(child.process.pid, gone)
    assert gone == Usage()


def test_commands_ignore_modules_in_the_current_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A user's folder named zteam does not shadow the package."""
    (tmp_path / "zteam").mkdir()
    (tmp_path / "zteam" / "__init__.py").write_text("raise SystemExit('shadowed')")
    monkeypatch.chdir(tmp_path)
    import subprocess

    done = subprocess.run(
        zteam_command("zteam", "--version"), capture_output=True, text=True, timeout=LIMIT, check=False
    )
    assert done.stdout.startswith("zteam "), done.stderr


def test_an_end_is_reported_while_a_grandchild_lives() -> None:
    """The end of a process is reported although its background process holds the output, and that process is ended."""
    code = (
        "import subprocess, sys\n"
        "subprocess.Popen([sys.executable, '-c', 'import time; time.sleep(600)'])\n"
        "print('started', flush=True)\n"
        "raise SystemExit(3)"
    )
    child = Child(code)
    try:
        assert child.ended.wait(LIMIT)
    finally:
        child.process.kill()
        assert child.process.join(LIMIT)


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
    child = Child(code)
    assert child.finish() == 3
    assert child.ended.is_set()
    assert child.heard == ["left"]
