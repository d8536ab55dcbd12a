"""Standard output that cannot be written, or that lacks characters."""

import io
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from zteam.cli.output import Output, OutputError, guarded
from zteam.team.launch.process import zteam_command

pytestmark = pytest.mark.gate
LIMIT = 60.0
COMMAND = zteam_command("zteam", "world", "check", "arena")


def run(command: Sequence[str], redirection: str, **environment: str) -> "subprocess.CompletedProcess[bytes]":
    """Run a command in a shell with this redirection after it."""
    words = " ".join(f"'{word}'" for word in command)
    return subprocess.run(
        ["bash", "-c", f"{words} {redirection}"],
        env={**os.environ, **environment},
        capture_output=True,
        timeout=LIMIT,
        check=False,
    )


@pytest.mark.few(4)
@pytest.mark.parametrize(
    ("redirection", "reason"), [(">/dev/full", "No space left on device"), (">&-", "Bad file descriptor")]
)
@pytest.mark.parametrize(
    "words",
    [
        ("zteam", "world", "check", "arena"),
        ("zteam", "doctor"),
        ("zteam", "--help"),
        ("zteam", "world", "--help"),
        ("zteam-sim", "--help"),
        ("zteam-robot", "--help"),
        ("zteam-tf", "--help"),
        ("zteam-monitor", "--help"),
        ("zteam-router", "--help"),
    ],
)
def test_a_result_that_cannot_be_written_is_one_line_and_1(
    words: tuple[str, ...], redirection: str, reason: str
) -> None:
    """A full disk and a closed descriptor give one line on standard error, without a traceback, and exit code 1."""
    # No router listens on this port, so no command starts anything.
    done = run(zteam_command(*words), redirection, ZTEAM_CONNECT="tcp/127.0.0.1:1")
    (line,) = done.stderr.decode().splitlines()
    assert line.startswith("zteam") and line.endswith(f": cannot write to standard output: {reason}")
    assert done.returncode == 1


def test_a_reader_that_has_gone_is_no_failure() -> None:
    """`zteam … | head` ends with 0 and prints no error."""
    done = run(COMMAND, "| true; exit ${PIPESTATUS[0]}")
    assert (done.returncode, done.stderr) == (0, b"")


def test_two_unwritable_outputs_give_exit_code_1() -> None:
    """With standard error unwritable too, a command still ends with exit code 1."""
    assert run(COMMAND, ">/dev/full 2>&1").returncode == 1
    assert run(COMMAND, ">&- 2>&-").returncode == 1


def test_characters_that_the_encoding_lacks_are_escaped(tmp_path: Path) -> None:
    """An output that is ASCII only gets escapes instead of an error."""
    world = tmp_path / "wörld.world"
    world.write_text('name "wörld"\ndefine r position ( size [1 1 1] )\nr ( name "a" )\n')
    command = zteam_command("zteam", "world", "check", str(world))
    plain = run(command, "", PYTHONIOENCODING="utf-8")
    ascii_only = run(command, "", PYTHONIOENCODING="ascii")
    assert plain.returncode == ascii_only.returncode == 0, ascii_only.stderr
    assert "wörld" in plain.stdout.decode()
    assert r"w\xf6rld" in ascii_only.stdout.decode("ascii")


class Full(io.StringIO):
    """A stream that cannot be written."""

    def write(self, text: str) -> int:
        """Fail."""
        raise OSError(28, "No space left on device")


def test_a_command_that_does_not_need_its_output_says_so_once_and_goes_on(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The failure is reported once, later output is dropped, and the body's exit code is kept."""
    monkeypatch.setattr("sys.stdout", Full())

    def body() -> int:
        for _ in range(3):
            sys.stdout.write("line\n")
        return 7

    assert guarded("monitor", body, needs_output=False) == 7
    expected = "monitor: cannot write to standard output: No space left on device; going on without it\n"
    assert capsys.readouterr().err == expected


def test_a_nested_command_decides_whether_it_needs_its_output(monkeypatch: pytest.MonkeyPatch) -> None:
    """`zteam up` goes on although `zteam` needs its output; afterwards standard output is the original stream."""
    full = Full()
    monkeypatch.setattr("sys.stdout", full)

    def inner() -> int:
        sys.stdout.write("line\n")
        return 5

    assert guarded("zteam", lambda: guarded("up", inner, needs_output=False)) == 5
    assert sys.stdout is full
    assert guarded("zteam", lambda: guarded("node", inner)) == 1


def test_output_after_a_failure_is_dropped() -> None:
    """Only the first failed write is reported, at once; the stream keeps its properties."""
    failures: list[OSError] = []
    output: Any = Output(Full(), failures.append)
    assert [output.write("a"), output.write("b")] == [1, 1]
    output.flush()
    assert [failure.errno for failure in failures] == [28]
    assert OutputError(BrokenPipeError(32, "Broken pipe")).reader_gone
    assert not output.isatty()
