"""What `zteam up` shows of a running team: lines of its processes, and how far it is, in words and as a bar."""

import io
import threading
from typing import cast

import numpy as np
import pytest

from support.limits import LIMIT
from support.log_capture import captured_log
from zteam.cli import up_display
from zteam.cli.tables import duration_text
from zteam.cli.up_display import RunDisplay, bar, open_display, progress_line
from zteam.messages import TeamState, TeamStatus, time_from_ns
from zteam.simulator.client import SimStatus
from zteam.team.launch.progress import Overview, TeamOverview

GO = TeamStatus(state=TeamState.GO, go_stamp=time_from_ns(500_000_000))
WAITING = TeamStatus(state=TeamState.WAITING, team_size=4, ready=np.array([0, 2], np.int32))


def world(seconds: float, **values: object) -> SimStatus:
    """A simulator's status at this simulated time."""
    known = {"world": "office", "robots": [0], "interval": 100_000_000, "seed": 1, "tick": 1, "real_time_factor": 1.0}
    return SimStatus(now=round(seconds * 1e9), **{**known, **values})  # type: ignore[arg-type]


HALF = world(15.5, real_time_factor=2.0)


@pytest.mark.parametrize(
    ("seen", "run_for", "text"),
    [
        ({"simulator": world(0.0)}, None, "starting"),
        ({"team": WAITING}, None, "before GO: 2 of 4 robots ready"),
        (
            {"team": TeamStatus(state=TeamState.WAITING, waiting_for="robot_1 (no scan)")},
            None,
            "before GO: 0 of 4 robots ready, waiting for robot_1 (no scan)",
        ),
        ({"team": WAITING, "simulator": world(1.0, paused=True)}, None, "before GO: 2 of 4 robots ready, paused"),
        ({"team": GO, "simulator": world(12.84, real_time_factor=1.003)}, None, "12.3 s simulated, 1.00 x real time"),
        ({"team": GO, "simulator": world(12.84, paused=True)}, None, "12.3 s simulated, paused"),
        ({"team": GO, "simulator": world(12.84), "held_by": "robot_2"}, None, "12.3 s simulated, held by robot_2"),
        ({"team": GO, "simulator": world(1212.5, finished=True)}, None, "1212 s simulated, finished"),
        ({"team": GO, "simulator": world(0.1)}, None, "0.0 s simulated, 1.00 x real time"),
        (
            {"team": GO, "simulator": world(15.5, real_time_factor=2.0)},
            30.0,
            "15.0 of 30 s, 2.00 x real time, 8 s left",
        ),
        (
            {"team": GO, "simulator": world(15.5, real_time_factor=2.0)},
            10.0,
            "15.0 of 10 s, 2.00 x real time, 0 s left",
        ),
        ({"team": GO}, None, "the simulator does not answer"),
        ({"team": GO, "is_simulated": False}, None, ""),
    ],
)
def test_the_line_says_how_the_team_does(seen: dict[str, object], run_for: float | None, text: str) -> None:
    """What is missing before GO; then the time since GO, the pace or why there is none, and the robots that drive."""
    driving = ["3 of 4 robots driving"] if seen.get("team") is GO else []
    found = progress_line(Overview(robots=4, driving=3, **seen), run_for)  # type: ignore[arg-type]
    assert found == ", ".join(filter(None, [text, *driving]))


def test_durations_and_bars() -> None:
    """A duration has no more than two units; a bar is never longer than its width."""
    durations = {0.4: "0 s", 59.4: "59 s", 60.0: "1 min 00 s", 3599.7: "1 h 00 min", 7512: "2 h 05 min"}
    assert {seconds: duration_text(seconds) for seconds in durations} == durations
    assert [bar(share) for share in (0.0, 0.5, 2.0)] == ["[-----------]", "[#####------]", "[###########]"]


class Terminal(io.StringIO):
    """Standard output that is a terminal."""

    def isatty(self) -> bool:
        """Yes."""
        return True


class Looks:
    """A watch that sees one moment; `over` is set at the second look."""

    def __init__(self) -> None:
        self.over = threading.Event()
        self._looks = 0

    def look(self) -> Overview:
        """The next look."""
        self._looks += 1
        if self._looks > 1:
            self.over.set()
        return Overview(robots=1, team=GO, simulator=world(10.5, real_time_factor=2.0))


@pytest.mark.parametrize(("run_for", "is_terminal"), [(100.0, False), (None, False), (20.0, True)])
def test_a_run_reports_how_far_it_is(run_for: float | None, is_terminal: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """In log lines where there is no terminal; there a run without an end is not looked at: nobody may read it."""
    for name in ("_LOG_PERIOD", "_LIVE_PERIOD"):
        monkeypatch.setattr(up_display, name, 0.001)
    looks, output = Looks(), Terminal() if is_terminal else io.StringIO()
    monkeypatch.setattr("sys.stdout", output)
    with captured_log() as captured, open_display("text", run_for) as display:
        display.say("starting")
        display.print("a line")
        with display.following(lambda: cast(TeamOverview, looks)):
            assert run_for is None or looks.over.wait(LIMIT)
    assert "a line\n" in output.getvalue()
    assert ("starting" in output.getvalue()) is is_terminal
    if is_terminal:
        assert "[#####------] 10.0 of 20 s, 2.00 x real time, 5 s left, 0 of 1 robot driving" in output.getvalue()
        assert not captured.lines
    elif run_for is None:
        assert not looks.over.is_set() and not captured.lines
    else:
        assert captured.lines[0] == "10.0 of 100 s, 2.00 x real time, 45 s left, 0 of 1 robot driving"


@pytest.fixture(autouse=True)
def colours(monkeypatch: pytest.MonkeyPatch) -> None:
    """The environment does not turn colours off, as an empty TERM does."""
    monkeypatch.delenv("NO_COLOR", raising=False)
    monkeypatch.setenv("TERM", "xterm")


def printed(monkeypatch: pytest.MonkeyPatch, output: io.StringIO, *lines: tuple[str, str]) -> str:
    """The output for (process, line) pairs."""
    monkeypatch.setattr("sys.stdout", output)
    display = RunDisplay(None)
    for name, line in lines:
        display.line(name, line)
    return output.getvalue()


def test_a_line_starts_with_the_name_of_its_process(monkeypatch: pytest.MonkeyPatch) -> None:
    """Once, and without the colours of the process; without own ones where the output is no terminal."""
    lines = (("robot_1", "12:00:00 [robot_1] GO: driving"), ("sim", "\033[31ma\033[0m [b] c\td"))
    assert printed(monkeypatch, io.StringIO(), *lines) == "[robot_1] 12:00:00 GO: driving\n[sim] a [b] c\td\n"


def test_a_terminal_shows_colours(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each process has one colour for its name in all lines, however many there are; the text is plain."""
    text = printed(
        monkeypatch, Terminal(), ("a", "one"), ("b", "two"), ("a", "three"), *((f"r{i}", "") for i in range(40))
    )
    first, second, third, *others = text.splitlines()
    color = first.partition("[a]")[0]
    assert color.startswith("\033[")
    assert third == f"{color}[a]\033[0m three"
    assert not second.startswith(color)
    assert all(line.startswith("\033[") for line in others)
