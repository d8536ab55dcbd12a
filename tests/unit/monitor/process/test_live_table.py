"""The monitor's live table: what stands above it, and that no text breaks it."""

from collections.abc import Sequence

import pytest

from support.monitor_desk import Open, Robot
from zteam.bus import MemoryHub
from zteam.messages import RobotState, RobotStatus
from zteam.monitor.process import display
from zteam.monitor.process.live_table import LiveTable
from zteam.monitor.process.members import Event
from zteam.monitor.process.start_gate import Gate
from zteam.monitor.process.table import Lines, Row, make_rows


@pytest.fixture(autouse=True)
def _columns(monkeypatch: pytest.MonkeyPatch) -> None:
    """A terminal as narrow as users have."""
    monkeypatch.setenv("COLUMNS", "80")


def say(gate: Gate, robot_id: int, state: int, text: str) -> None:
    """A process holds the robot's name and publishes its state."""
    gate.take_token(robot_id, True)
    status = RobotStatus(robot_id=robot_id, state=state, text=text, reason=text, behavior="wander")
    gate.take_status(robot_id, status, 0.0)


def draw(gate: Gate, *events: Event) -> None:
    """Print what a terminal shows: the events, and the table as it stands at the end."""
    table = LiveTable()
    with table.live:
        table.print_table(make_rows(gate, {}, {}, 1.0), ["waiting for robot_0"])
        for event in events:
            table.show(event)


def test_the_table_stands_below_the_events(capsys: pytest.CaptureFixture[str]) -> None:
    """Events are printed above the table, in the exact words that users and scripts look for."""
    gate = Gate([0], 1)
    say(gate, 0, RobotState.BOOT, "waiting for a scan")
    draw(gate, Event("lost", 3, "lost"), Event("go", None, "All robots GO!"))
    lines = [line.rstrip() for line in capsys.readouterr().out.splitlines()]
    told = [line for line in lines if line in ("robot_3 lost", "All robots GO!")]
    assert told == ["robot_3 lost", "All robots GO!"]
    assert lines.index("All robots GO!") < len(lines) - 1 - lines[::-1].index("waiting for robot_0")


@pytest.mark.parametrize("text", ["[/etc/passwd]", "[bold]x", "[link=http://x]", "\x1b[2J"])
def test_any_text_of_a_robot_is_shown_as_it_is(capsys: pytest.CaptureFixture[str], text: str) -> None:
    """A robot's text is neither markup nor a command to the terminal."""
    gate = Gate([0], 1)
    say(gate, 0, RobotState.FAULT, text)
    draw(gate, *gate.take_events())
    shown = capsys.readouterr().out
    assert "\x1b[2J" not in shown
    assert shown.count(text.replace("\x1b", "")) >= 2


class Screen(Lines):
    """A live output that notes the states of robot 0 that it draws."""

    is_live = True

    def __init__(self) -> None:
        self.drawn: list[str] = []

    def print_table(self, rows: Sequence[Row], notes: Sequence[str]) -> None:
        """Draw."""
        self.drawn.append(rows[0].state)


def test_the_monitor_draws_the_table_again_and_again(
    hub: MemoryHub, open_desk: Open, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without an option, and also where there is no event: a robot's new state is in the table."""
    monkeypatch.setattr(display, "_LIVE_PERIOD", 0.0)
    screen = Screen()
    desk = open_desk(0, 1, output=screen)
    desk.look()
    assert screen.drawn[-1] == "absent"
    Robot(hub, 0).say(RobotState.BOOT)
    desk.look()
    assert screen.drawn[-1] == "boot"
