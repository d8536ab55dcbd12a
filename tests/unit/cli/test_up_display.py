"""What `zteam up` shows of a running team: lines of its processes; without a terminal now and then how far it is."""

import io
import threading
from collections.abc import Iterable
from typing import cast

import pytest

from support.limits import LIMIT
from support.log_capture import captured_log
from zteam.cli import up_display
from zteam.cli.up_display import Printer, open_display
from zteam.messages import TeamState, TeamStatus
from zteam.simulator.client import SimStatus
from zteam.team.launch.progress import Overview, TeamOverview

GO = TeamStatus(state=TeamState.GO)


class Terminal(io.StringIO):
    """Standard output that is a terminal."""

    def isatty(self) -> bool:
        """Yes."""
        return True


class Looks:
    """A watch that sees the world at these simulated times, and the last of them for ever."""

    def __init__(self, seconds: Iterable[float]) -> None:
        self._seconds = list(seconds)
        self.over = threading.Event()

    def look(self) -> Overview:
        """The next look."""
        if len(self._seconds) == 1:
            self.over.set()
        seconds = self._seconds.pop(0) if len(self._seconds) > 1 else self._seconds[0]
        return Overview(
            robots=1, team=GO, simulator=SimStatus("w", [0], 1, 1, round(seconds * 1e9), 5, real_time_factor=2.0)
        )


def told(looks: Looks, run_for: float | None, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What is logged while a run of `run_for` simulated seconds is looked at."""
    monkeypatch.setattr(up_display, "_LOG_PERIOD", 0.0)
    monkeypatch.setattr(up_display, "_LIVE_PERIOD", 0.0)
    with captured_log() as captured, open_display("text", run_for) as display:
        display.say("not shown")
        display.print("a line")
        with display.following(lambda: cast(TeamOverview, looks)):
            assert run_for is None or looks.over.wait(LIMIT)
    return list(captured.lines)


def test_a_long_run_is_logged_at_every_tenth(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """One line for each tenth that was passed, none at the end, and nothing but the lines on standard output."""
    monkeypatch.setattr(up_display, "_LOG_PAUSE", 0.0)
    lines = told(Looks([5, 10, 12, 19.9, 20, 58, 59, 100, 100]), 100.0, monkeypatch)
    assert lines == [
        "10 % of 100 simulated seconds, 2.00 x real time, 45 s left",
        "20 % of 100 simulated seconds, 2.00 x real time, 40 s left",
        "50 % of 100 simulated seconds, 2.00 x real time, 21 s left",
        "90 % of 100 simulated seconds, 2.00 x real time, 0 s left",
    ]
    assert capsys.readouterr().out == "a line\n"


def test_a_short_run_is_not_logged(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ten host seconds lie between the start, one line and the next."""
    assert told(Looks([5, 15, 25, 35, 45]), 50.0, monkeypatch) == []


def test_a_run_without_an_end_is_not_looked_at(monkeypatch: pytest.MonkeyPatch) -> None:
    """The line cannot be seen, so the simulator is not asked."""
    looks = Looks([1.0, 2.0])
    assert told(looks, None, monkeypatch) == []
    assert not looks.over.is_set()


@pytest.fixture(autouse=True)
def colours(monkeypatch: pytest.MonkeyPatch) -> None:
    """The environment does not turn colours off, as an empty TERM does."""
    monkeypatch.delenv("NO_COLOR", raising=False)
    monkeypatch.setenv("TERM", "xterm")


def printed(monkeypatch: pytest.MonkeyPatch, output: io.StringIO, *lines: tuple[str, str]) -> str:
    """The output of a Printer for (process, line) pairs."""
    monkeypatch.setattr("sys.stdout", output)
    printer = Printer(print)
    for name, line in lines:
        printer.line(name, line)
    return output.getvalue()


def test_a_line_starts_with_the_name_of_its_process(monkeypatch: pytest.MonkeyPatch) -> None:
    """A line starts with its process's name, once and without colours if the output is no terminal."""
    text = printed(monkeypatch, io.StringIO(), ("robot_1", "12:00:00 [robot_1] GO: driving"), ("sim", "a [b] c"))
    assert text == "[robot_1] 12:00:00 GO: driving\n[sim] a [b] c\n"


def test_a_terminal_shows_colours(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each process has one colour for its name in all lines; the text is plain."""
    text = printed(monkeypatch, Terminal(), ("a", "one"), ("b", "two"), ("a", "three"))
    first, second, third = text.splitlines()
    color = first.partition("[a]")[0]
    assert color.startswith("\033[")
    assert third == f"{color}[a]\033[0m three"
    assert not second.startswith(color)


def test_no_color_turns_colours_off(monkeypatch: pytest.MonkeyPatch) -> None:
    """With NO_COLOR set there are no colours, even on a terminal (https://no-color.org)."""
    monkeypatch.setenv("NO_COLOR", "1")
    assert printed(monkeypatch, Terminal(), ("a", "one")) == "[a] one\n"


def test_every_process_of_a_large_team_has_a_colour(monkeypatch: pytest.MonkeyPatch) -> None:
    """With more processes than colours, colours repeat."""
    text = printed(monkeypatch, Terminal(), *((f"robot_{i}", "x") for i in range(40)))
    assert all(line.startswith("\033[") for line in text.splitlines())
