"""Standard output that cannot be written, or that lacks characters, and how a command's process ends."""

import io
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from support.limits import LIMIT
from zteam.node.output import Output, OutputError, guarded
from zteam.team.launch.process import zteam_command

COMMAND = zteam_command("zteam", "world", "check", "arena")


def run(command: list[str], redirection: str, **environment: str) -> "subprocess.CompletedProcess[bytes]":
    """Run a command in a shell with this redirection after it."""
    words = " ".join(f"'{word}'" for word in command)
    return subprocess.run(
        ["bash", "-c", f"{words} {redirection}"],
        env={**os.environ, **environment},
        capture_output=True,
        timeout=LIMIT,
        check=False,
    )


@pytest.mark.gate
@pytest.mark.parametrize(
    ("redirection", "reason"), [(">/dev/full", "No space left on device"), (">&-", "Bad file descriptor")]
)
@pytest.mark.parametrize("words", ["zteam world check arena", "zteam doctor", "zteam --help", "zteam-sim --help"])
def test_a_result_that_cannot_be_written_is_one_line_and_1(words: str, redirection: str, reason: str) -> None:
    """A full disk and a closed descriptor give one line on standard error, without a traceback, and exit code 1."""
    # No router listens on this port, so no command starts anything.
    done = run(zteam_command(*words.split()), redirection, ZTEAM_CONNECT="tcp/127.0.0.1:1")
    (line,) = done.stderr.decode().splitlines()
    assert line.startswith("zteam") and line.endswith(f": cannot write to standard output: {reason}")
    assert done.returncode == 1


@pytest.mark.gate
def test_a_reader_that_has_gone_is_no_failure() -> None:
    """`zteam … | head` ends with 0 and prints no error; with standard error unwritable too a command ends with 1."""
    done = run(COMMAND, "| true; exit ${PIPESTATUS[0]}")
    assert (done.returncode, done.stderr) == (0, b"")
    assert run(COMMAND, ">/dev/full 2>&1").returncode == 1


@pytest.mark.gate
def test_characters_that_the_encoding_lacks_are_escaped(tmp_path: Path) -> None:
    """An output that is ASCII only gets escapes instead of an error."""
    world = tmp_path / "wörld.world"
    world.write_text('name "wörld"\ndefine r position ( size [1 1 1] )\nr ( name "a" )\n')
    command = zteam_command("zteam", "world", "check", str(world))
    assert "wörld" in run(command, "", PYTHONIOENCODING="utf-8").stdout.decode()
    assert r"w\xf6rld" in run(command, "", PYTHONIOENCODING="ascii").stdout.decode("ascii")


class Full(io.StringIO):
    """A stream that cannot be written."""

    def write(self, text: str) -> int:
        """Fail."""
        raise OSError(28, "No space left on device")


def test_a_command_that_does_not_need_its_output_says_so_once_and_goes_on(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Later output is dropped, the exit code is kept. A nested command decides: `zteam up` goes on within `zteam`."""
    full = Full()
    monkeypatch.setattr("sys.stdout", full)

    def body() -> int:
        for _ in range(3):
            sys.stdout.write("line\n")
        return 7

    assert guarded("monitor", body, needs_output=False) == 7
    assert guarded("zteam", lambda: guarded("monitor", body, needs_output=False)) == 7
    told = "monitor: cannot write to standard output: No space left on device; going on without it\n"
    assert capsys.readouterr().err == 2 * told
    assert sys.stdout is full
    assert guarded("zteam", lambda: guarded("node", body)) == 1


def test_output_after_a_failure_is_dropped() -> None:
    """Only the first failed write is reported, at once; the stream keeps its properties."""
    failures: list[OSError] = []
    output: Any = Output(Full(), failures.append)
    assert [output.write("a"), output.write("b")] == [1, 1]
    output.flush()
    assert [failure.errno for failure in failures] == [28]
    assert OutputError(BrokenPipeError(32, "Broken pipe")).reader_gone
    assert not output.isatty()


BOMB = "import os, sys; sys.bomb = type('Bomb', (), {'__del__': lambda self, end=os.abort: end()})()\n"
"""Aborts the process when the interpreter is taken apart, as a late callback of foreign code does."""


def run_code(code: str) -> "subprocess.CompletedProcess[str]":
    """Run `code` in a process of its own."""
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=LIMIT, check=False)


def test_leave_ends_with_the_exit_code_after_all_that_a_normal_end_does() -> None:
    """Threads are waited for, exit handlers run and output is flushed, in this order; then the exit code is kept.

    Without `leave` the process ends by SIGABRT.
    """
    assert run_code(BOMB + "sys.exit(3)").returncode == -6
    done = run_code(
        BOMB + "import atexit, threading\n"
        "from zteam.node.leaving import leave\n"
        "atexit.register(print, 'handler')\n"
        "may = threading.Event()\n"
        "threading.Thread(target=lambda: (may.wait(30), print('thread'))).start()\n"
        "threading.Timer(0.1, may.set).start()\n"
        "leave(3)"
    )
    assert (done.returncode, done.stdout) == (3, "thread\nhandler\n")
    for close in ("sys.stdout = None", "sys.stdout.close()"):
        assert run_code(BOMB + f"from zteam.node.leaving import leave\n{close}\nleave(3)").returncode == 3


@pytest.mark.gate
def test_commands_leave() -> None:
    """A command that ran, one of a process too, ends without taking the interpreter apart."""
    for words in ("'zteam-sim', 'wander'", "'behaviors', 'wandr'"):
        code = f"sys.argv = ['zteam', {words}]; import runpy; runpy.run_module('zteam', run_name='__main__')"
        done = run_code(BOMB + code)
        assert (done.returncode, "wander" in done.stderr) == (2, True), done.stderr
