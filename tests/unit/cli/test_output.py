"""Standard output that cannot be written, or not every character."""

import io
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from zteam.cli.output import Output, OutputError, guarded
from zteam.launch.process import zteam_command

LIMIT = 60.0
COMMAND = zteam_command("zteam", "world", "check", "arena")


def run(command: Sequence[str], redirection: str, **environment: str) -> "subprocess.CompletedProcess[bytes]":
    """A command as a shell runs it with this redirection behind it."""
    words = " ".join(f"'{word}'" for word in command)
    return subprocess.run(
        ["bash", "-c", f"{words} {redirection}"],
        env={**os.environ, **environment},
        capture_output=True,
        timeout=LIMIT,
        check=False,
    )


@pytest.mark.parametrize(
    ("redirection", "reason"), [(">/dev/full", "No space left on device"), (">&-", "Bad file descriptor")]
)
@pytest.mark.parametrize("arguments", [("world", "check", "arena"), ("--help",), ("world", "--help"), ("doctor",)])
def test_a_result_that_cannot_be_written_is_one_line_and_1(
    arguments: tuple[str, ...], redirection: str, reason: str
) -> None:
    """A full disk and a closed descriptor are told on standard error, without a traceback."""
    # Nothing listens there, and nothing is started.
    done = run(zteam_command("zteam", *arguments), redirection, ZTEAM_CONNECT="tcp/127.0.0.1:1")
    (line,) = done.stderr.decode().splitlines()
    assert line.startswith("zteam") and line.endswith(f": cannot write to standard output: {reason}")
    assert done.returncode == 1


def test_a_reader_that_has_gone_is_no_failure() -> None:
    """`zteam … | head`: the command ends without a word."""
    done = run(COMMAND, "| true; exit ${PIPESTATUS[0]}")
    assert (done.returncode, done.stderr) == (0, b"")


def test_both_outputs_full_is_an_orderly_end() -> None:
    """Nothing can be said any more, and the exit code still tells."""
    assert run(COMMAND, ">/dev/full 2>&1").returncode == 1
    assert run(COMMAND, ">&- 2>&-").returncode == 1


def test_every_character_can_be_printed(tmp_path: Path) -> None:
    """On an output of ASCII alone the others are escaped."""
    world = tmp_path / "wörld.world"
    world.write_text('name "wörld"\ndefine r position ( size [1 1 1] )\nr ( name "a" )\n')
    command = zteam_command("zteam", "world", "check", str(world))
    plain = run(command, "", PYTHONIOENCODING="utf-8")
    ascii_only = run(command, "", PYTHONIOENCODING="ascii")
    assert plain.returncode == ascii_only.returncode == 0, ascii_only.stderr
    assert "wörld" in plain.stdout.decode()
    assert r"w\xf6rld" in ascii_only.stdout.decode("ascii")


class Full(io.StringIO):
    """A stream without room."""

    def write(self, text: str) -> int:
        """Fail."""
        raise OSError(28, "No space left on device")


def test_a_command_that_goes_on_says_so_once(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """All that is printed afterwards is dropped, and the body's own exit code counts."""
    monkeypatch.setattr("sys.stdout", Full())

    def body() -> int:
        for _ in range(3):
            sys.stdout.write("line\n")
        return 7

    assert guarded("monitor", body, needs_output=False) == 7
    told = "monitor: cannot write to standard output: No space left on device; going on without it\n"
    assert capsys.readouterr().err == told


def test_a_command_within_another_decides(monkeypatch: pytest.MonkeyPatch) -> None:
    """`zteam up` goes on though `zteam` itself needs its output, which comes back afterwards."""
    full = Full()
    monkeypatch.setattr("sys.stdout", full)

    def inner() -> int:
        sys.stdout.write("line\n")
        return 5

    assert guarded("zteam", lambda: guarded("up", inner, needs_output=False)) == 5
    assert sys.stdout is full
    assert guarded("zteam", lambda: guarded("node", inner)) == 1


def test_what_is_written_afterwards_is_dropped() -> None:
    """The failure is reported at once and one time; the stream's own properties stay."""
    failures: list[OSError] = []
    output: Any = Output(Full(), failures.append)
    assert [output.write("a"), output.write("b")] == [1, 1]
    output.flush()
    assert [failure.errno for failure in failures] == [28]
    assert OutputError(BrokenPipeError(32, "Broken pipe")).reader_gone
    assert not output.isatty()
