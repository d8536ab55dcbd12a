"""One child process: its output, its end, its memory, and what it inherits."""

import os
import signal
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from zteam.launch.process import Process, Usage, exit_text, measure_usage, zteam_command

LIMIT = 30.0
"""Host seconds that a small child may take on a crowded machine."""


class Child:
    """A Process that runs a Python text, and what was told of it."""

    def __init__(self, code: str, lifeline: int) -> None:
        self.heard: list[str] = []
        self.ended = threading.Event()
        self.process = Process(
            "child",
            [sys.executable, "-c", code],
            lifeline,
            on_line=lambda _process, line: self.heard.append(line),
            on_exit=lambda _process: self.ended.set(),
        )

    def finish(self) -> int | None:
        """Wait for its end; its exit code."""
        assert self.process.join(LIMIT)
        return self.process.exit_code


@pytest.fixture
def lifeline() -> Iterator[int]:
    """The read end of a pipe as the supervisor hands it to children."""
    reader, writer = os.pipe()
    yield reader
    os.close(reader)
    os.close(writer)


def test_lines_come_in_order_from_both_outputs(lifeline: int) -> None:
    """Standard output and error are one stream of lines; what is no UTF-8 is replaced, not fatal."""
    code = (
        "import os\n"
        "os.write(1, b'one\\n'); os.write(2, b'two\\n'); os.write(1, b'\\xff three\\n'); os.write(1, b'no newline')"
    )
    child = Child(code, lifeline)
    assert child.finish() == 0
    assert child.heard == ["one", "two", "� three", "no newline"]
    assert list(child.process.lines) == child.heard


def test_only_the_newest_lines_are_kept(lifeline: int) -> None:
    """A process that talks for days does not fill the launcher's memory."""
    child = Child("for i in range(5000): print(i)", lifeline)
    assert child.finish() == 0
    assert len(child.heard) == 5000
    assert len(child.process.lines) < 1000
    assert child.process.lines[-1] == "4999"


def test_the_end_is_told_after_the_last_line(lifeline: int) -> None:
    """on_exit comes once everything the process said has been handed on, with the exit code known."""
    child = Child("print('last words'); raise SystemExit(7)", lifeline)
    assert child.ended.wait(LIMIT)
    assert child.heard == ["last words"]
    assert child.process.exit_code == 7
    assert not child.process.running
    assert child.finish() == 7


def test_a_signal_is_a_negative_exit_code(lifeline: int) -> None:
    """As in subprocess, and in words for people."""
    child = Child("import os, signal; os.kill(os.getpid(), signal.SIGKILL)", lifeline)
    assert child.finish() == -signal.SIGKILL
    assert exit_text(child.process.exit_code) == "killed by SIGKILL"


@pytest.mark.parametrize(
    ("code", "text"),
    [(None, "still running"), (0, "exit code 0"), (2, "exit code 2"), (-15, "killed by SIGTERM"), (-99, "signal 99")],
)
def test_exit_codes_have_words(code: int | None, text: str) -> None:
    """What people read about an end names the signal, also one that has no name."""
    assert text in exit_text(code)


def test_the_child_has_a_group_of_its_own(lifeline: int) -> None:
    """The terminal's Ctrl+C, sent to the launcher's group, does not reach it."""
    child = Child("import os; print(os.getpgid(0) == os.getpid())", lifeline)
    child.finish()
    assert child.heard == ["True"]


def test_the_lifeline_is_inherited_and_nothing_else(lifeline: int) -> None:
    """Besides its own three, a child holds the lifeline's read end alone: the write end would keep it from ever ending,
    and so would the stdin of an earlier child."""
    code = (
        "import os\n"
        "number = int(os.environ['ZTEAM_PARENT_PIPE'])\n"
        "os.fstat(number)\n"
        # listdir's own descriptor is closed again when the others are looked at.
        "open_ones = [n for n in os.listdir('/proc/self/fd') if os.path.exists(f'/proc/self/fd/{n}')]\n"
        "print(sorted({int(n) for n in open_ones} - {0, 1, 2, number}))"
    )
    first = Child("input()", lifeline)
    child = Child(code, lifeline)
    child.finish()
    assert child.heard == ["[]"]
    first.process.write_line("end")
    first.finish()


def test_a_line_reaches_its_standard_input(lifeline: int) -> None:
    """write_line hands over one line and then the end of the input."""
    child = Child("import sys; print([line for line in sys.stdin])", lifeline)
    child.process.write_line("tcp/127.0.0.1:7447")
    child.finish()
    assert child.heard == ["['tcp/127.0.0.1:7447\\n']"]


def test_writing_to_one_that_has_ended_is_no_error(lifeline: int) -> None:
    """Its exit is told elsewhere; the launcher must not stumble over the broken pipe."""
    child = Child("", lifeline)
    assert child.ended.wait(LIMIT)
    child.process.write_line("too late")
    assert child.finish() == 0


def test_joining_does_not_wait_longer_than_asked(lifeline: int) -> None:
    """join says that the process still runs, and that is no end of the matter."""
    child = Child("input()", lifeline)
    assert not child.process.join(0.0)
    assert child.process.running
    assert child.process.exit_code is None
    child.process.write_line("end")
    assert child.finish() == 0


def test_killing_ends_what_it_started(lifeline: int) -> None:
    """A kill takes the whole group: no grandchild stays."""
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

    process = Process(
        "parent", [sys.executable, "-c", code], lifeline, on_line=take, on_exit=lambda _process: told.set()
    )
    assert told.wait(LIMIT)
    handle = os.pidfd_open(int(heard[0]))
    process.kill()
    # The grandchild held the output too, so the reader's end says that both are gone.
    assert process.join(LIMIT)
    os.close(handle)
    assert process.exit_code == -signal.SIGKILL


def test_a_frozen_process_can_be_killed(lifeline: int) -> None:
    """SIGSTOP keeps nobody from SIGKILL."""
    child = Child("input()", lifeline)
    child.process.signal(signal.SIGSTOP)
    child.process.kill()
    assert child.finish() == -signal.SIGKILL


def test_signals_after_the_end_go_nowhere(lifeline: int) -> None:
    """The number may be another process's by then."""
    child = Child("", lifeline)
    child.finish()
    child.process.terminate()
    child.process.signal(signal.SIGKILL)
    child.process.measure()
    assert child.process.exit_code == 0


def test_memory_is_the_peak(lifeline: int) -> None:
    """60 MB that were touched and given back still show in both figures; processor time is counted."""
    code = (
        "import mmap\nm = mmap.mmap(-1, 60_000_000)\nm.write(b'x' * 60_000_000)\nprint('full', flush=True)\ninput()\n"
    )
    code += "m.close()\nprint('empty', flush=True)\ninput()"
    reader, writer = os.pipe()
    told = threading.Semaphore(0)
    process = Process(
        "big",
        [sys.executable, "-c", code.replace("input()", f"import os; os.read({reader}, 1)")],
        reader,
        on_line=lambda *_: told.release(),
        on_exit=lambda _process: told.release(),
    )
    try:
        assert told.acquire(timeout=LIMIT)
        process.measure()
        full = process.usage.pss_mb
        assert full > 60
        os.write(writer, b"1")
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
        os.close(reader)
        os.close(writer)


def test_a_process_that_is_gone_leaves_its_figures(lifeline: int) -> None:
    """The report still has what was measured before the end."""
    child = Child("input()", lifeline)
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


def test_commands_ignore_what_lies_in_the_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A user's folder named zteam does not shadow the package."""
    (tmp_path / "zteam").mkdir()
    (tmp_path / "zteam" / "__init__.py").write_text("raise SystemExit('shadowed')")
    monkeypatch.chdir(tmp_path)
    import subprocess

    done = subprocess.run(
        zteam_command("zteam", "--version"), capture_output=True, text=True, timeout=LIMIT, check=False
    )
    assert done.stdout.startswith("zteam "), done.stderr


def test_an_end_is_told_though_a_grandchild_lives(lifeline: int) -> None:
    """A process that started something in the background and died is dead; what it left does not stay."""
    code = (
        "import subprocess, sys\n"
        "subprocess.Popen([sys.executable, '-c', 'import time; time.sleep(600)'])\n"
        "print('started', flush=True)\n"
        "raise SystemExit(3)"
    )
    child = Child(code, lifeline)
    try:
        assert child.ended.wait(2.0)
    finally:
        child.process.kill()
        assert child.process.join(LIMIT)
