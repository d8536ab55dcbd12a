"""How far a run is, in words and as a bar."""

import numpy as np
import pytest

from zteam.cli.progress_text import duration_text, progress_line
from zteam.messages import TeamState, TeamStatus, time_from_ns
from zteam.simulator.client import SimStatus
from zteam.team.launch.progress import Overview

WAITING = TeamStatus(state=TeamState.WAITING, team_size=4, ready=np.array([0, 2], np.int32))
GO = TeamStatus(state=TeamState.GO, go_stamp=time_from_ns(500_000_000))


def world(seconds: float, **values: object) -> SimStatus:
    """A simulator's status at this simulated time."""
    known = {"world": "office", "robots": [0], "interval": 100_000_000, "seed": 1, "tick": 1, "real_time_factor": 1.0}
    return SimStatus(now=round(seconds * 1e9), **{**known, **values})  # type: ignore[arg-type]


def line(run_for: float | None = None, columns: int = 77, robots: int = 4, **values: object) -> str:
    """The line for a team of four robots, three of which drive."""
    return progress_line(Overview(robots=robots, driving=3, **values), run_for, columns)  # type: ignore[arg-type]


def test_before_the_monitor_speaks_the_team_starts() -> None:
    """Nothing else is known then."""
    assert line(simulator=world(0.0)) == "starting"


def test_before_go_the_line_says_what_is_missing() -> None:
    """The robots that are ready, and what the gate waits for in the monitor's words."""
    assert line(team=WAITING) == "before GO: 2 of 4 robots ready"
    words = TeamStatus(state=TeamState.WAITING, waiting_for="robot_1 (no scan)")
    assert line(team=words) == "before GO: 0 of 4 robots ready, waiting for robot_1 (no scan)"
    assert line(columns=40, team=words) == "before GO: 0 of 4 robots ready, waiting "
    assert line(team=WAITING, simulator=world(1.0, paused=True)) == "before GO: 2 of 4 robots ready, paused"


@pytest.mark.parametrize(
    ("seen", "text"),
    [
        (
            {"simulator": world(12.84, real_time_factor=1.00321)},
            "12.3 s simulated, 1.00 x real time, 3 of 4 robots driving",
        ),
        ({"simulator": world(12.84, paused=True)}, "12.3 s simulated, paused, 3 of 4 robots driving"),
        ({"simulator": world(12.84), "held_by": "robot_2"}, "12.3 s simulated, held by robot_2, 3 of 4 robots driving"),
        ({"simulator": world(12.84, finished=True)}, "12.3 s simulated, finished, 3 of 4 robots driving"),
        ({"simulator": world(0.1)}, "0.0 s simulated, 1.00 x real time, 3 of 4 robots driving"),
        ({}, "the simulator does not answer, 3 of 4 robots driving"),
        ({"is_simulated": False}, "3 of 4 robots driving"),
        ({"is_simulated": False, "robots": 1}, "3 of 1 robot driving"),
    ],
)
def test_after_go_the_line_says_how_the_world_goes(seen: dict[str, object], text: str) -> None:
    """Simulated time since GO, the pace or why there is none, and the robots that drive."""
    assert line(team=GO, **seen) == text  # type: ignore[arg-type]


def test_a_run_with_an_end_has_a_bar_and_the_time_left() -> None:
    """The bar takes the room that the words leave, and the time left is the host's."""
    simulator = world(15.5, real_time_factor=2.0)
    words = "15.0 of 30 s, 2.00 x real time, 8 s left, 3 of 4 robots driving"
    assert line(30.0, team=GO, simulator=simulator) == f"[#####------] {words}"
    assert line(30.0, 117, team=GO, simulator=simulator) == f"[{'#' * 19}{'-' * 19}] {words}"
    assert line(30.0, len(words) + 8, team=GO, simulator=simulator) == words
    full = line(10.0, 117, team=GO, simulator=simulator)
    assert full.startswith(f"[{'#' * 38}] 15.0 of 10 s, 2.00 x real time, 0 s left")


def test_a_narrow_terminal_gets_whole_parts() -> None:
    """What does not fit is left out from the end; only the very first part is cut."""
    simulator = world(12.8)
    assert line(30.0, 47, team=GO, simulator=simulator) == "12.3 of 30 s, 1.00 x real time, 18 s left"
    assert line(30.0, 15, team=GO, simulator=simulator) == "12.3 of 30 s"
    assert line(30.0, 7, team=GO, simulator=simulator) == "12.3 of"
    assert line(30.0, -2, team=GO, simulator=simulator) == ""


def test_words_from_the_bus_are_plain_ascii() -> None:
    """Controls and wide characters would break the line."""
    words = TeamStatus(state=TeamState.WAITING, waiting_for="\x1b[2J\n山")
    assert line(team=words) == r"before GO: 0 of 4 robots ready, waiting for  [2J \u5c71"


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(0.4, "0 s"), (59.4, "59 s"), (60.0, "1 min 00 s"), (3599.7, "1 h 00 min"), (7512, "2 h 05 min")],
)
def test_durations(seconds: float, text: str) -> None:
    """No more than two units."""
    assert duration_text(seconds) == text
