"""What `zteam log` makes of names and lines."""

import json

import pytest

from support.commands import Run
from support.named_sessions import open_named
from zteam.bus import MemoryHub
from zteam.cli import log
from zteam.clock import local_time_text
from zteam.errors import UsageError
from zteam.node.logs import LogLine

LINE = LogLine(1_700_000_000_042_000_000, "robot_1", 30, "no way\nat all", "plan.py", "step", 7)


@pytest.mark.parametrize(
    ("text", "pattern"),
    [
        ("robot_1", "robot_1"),
        ("/sim", "sim"),
        ("robot_*", "robot_$*"),
        ("robot_$*", "robot_$*"),
        ("*", "*"),
        ("*_1", "$*_1"),
    ],
)
def test_a_name_may_be_a_pattern(text: str, pattern: str) -> None:
    """`*` stands for any text, as in a shell, and `$*` as in keys; a leading slash is dropped; a key is no name."""
    assert log.name_pattern(text) == pattern
    for key in ("robot_0/odom", "robot 0/", "**", "", "a?b"):
        with pytest.raises(UsageError):
            log.name_pattern(key)


def test_a_line_looks_like_its_process_prints_it() -> None:
    """A line has the host's time with milliseconds, process, level unless it is info, and text."""
    stamp = local_time_text(LINE.time_ns) + ".042"
    assert log.format_line(LINE, color=False) == f"{stamp} [robot_1] warning: no way\n    at all"
    info = LogLine(LINE.time_ns, "sim", 20, "tick\tand \x1b[2Jbell\x07")
    assert log.format_line(info, color=False) == f"{stamp} [sim] tick\tand \ufffd[2Jbell\ufffd"


def test_colours_tell_the_level() -> None:
    """In a terminal errors are red, warnings yellow, debug lines faint, and others plain."""
    codes = {
        level: log.format_line(LogLine(1, "sim", level, "x"), color=True).partition("m")[0]
        for level in (10, 30, 40, 50)
    }
    assert codes == {10: "\033[2", 30: "\033[33", 40: "\033[31", 50: "\033[31"}
    assert "\033" not in log.format_line(LogLine(1, "sim", 20, "x"), color=True)


def test_json_has_the_fields_of_json_logs() -> None:
    """A line as JSON has the names that `--log-format json` uses, and the place in the source."""
    assert json.loads(log.format_json(LINE)) == {
        "time_ns": LINE.time_ns,
        "process": "robot_1",
        "level": "warning",
        "text": "no way\nat all",
        "file": "plan.py",
        "function": "step",
        "line": 7,
    }


def test_an_unknown_name_is_answered_with_the_living_ones(tools: MemoryHub, run: Run) -> None:
    """A name that no living process has is one line; a living one and a pattern are not refused."""
    told = "zteam log: no process robto_1, x; {}\n"
    none = "none is alive (start a team with 'zteam up')"
    assert run("zteam log robto_1 x --once", 1).err == told.format(none)
    for name in ("sim", "robot_1"):
        open_named(tools, name)
    assert run("zteam log robto_1 sim x 'y*' --once", 1).err == told.format("alive: robot_1, sim")
    assert run("zteam log sim 'y*' --once").err == "sim does not answer: only its new lines are shown\n"
