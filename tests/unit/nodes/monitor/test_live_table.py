"""The monitor's live table: what its rows say, and that no text breaks it."""

import pytest

from zteam import names
from zteam.bus import MemoryHub
from zteam.messages import RobotState, RobotStatus
from zteam.nodes.monitor.live_table import LiveTable
from zteam.nodes.monitor.members import Event
from zteam.nodes.monitor.start_gate import Gate
from zteam.runtime.node import Node
from zteam.runtime.shutdown import Stop


@pytest.fixture
def node(monkeypatch: pytest.MonkeyPatch) -> Node:
    """The monitor's node; the table is wide enough for every row."""
    monkeypatch.setenv("COLUMNS", "160")
    return Node(names.MONITOR, MemoryHub().bus(), Stop())


def say(gate: Gate, robot_id: int, state: int, text: str = "") -> None:
    """A process holds the robot's name and publishes its state."""
    gate.take_token(robot_id, "a", True)
    ready = state in (RobotState.READY, RobotState.RUNNING)
    gate.take_status(robot_id, RobotStatus(robot_id=robot_id, is_ready=ready, state=state, text=text), 0.0)


def draw(node: Node, gate: Gate, *events: Event) -> None:
    """Print what a terminal shows: the events, and the table as it stands at the end."""
    with LiveTable() as table:
        table.watch(node, gate)
        for event in events:
            table.show(event)


def test_a_row_for_every_robot(node: Node, capsys: pytest.CaptureFixture[str]) -> None:
    """Name, state, epoch and text of each robot, absent and lost ones included, and which robots are waited for."""
    gate = Gate([0, 1, 2, 3, 4], 5)
    say(gate, 0, RobotState.RUNNING, "clear ahead")
    say(gate, 1, RobotState.BOOT, "waiting for a scan")
    say(gate, 2, RobotState.READY)
    say(gate, 4, RobotState.STOPPED)
    for robot_id in (2, 4):
        gate.take_token(robot_id, "a", False)
    draw(node, gate)
    shown = capsys.readouterr().out
    rows = {words[0]: words for line in shown.splitlines() if (words := line.strip("│┃ ").split())}
    assert rows["robot_0"][2] == "running"
    assert rows["robot_0"][-2:] == ["clear", "ahead"]
    assert rows["robot_1"][2] == "boot"
    assert rows["robot_2"][2] == "lost"
    assert rows["robot_3"][2] == "absent"
    assert rows["robot_4"][2] == "stopped"
    assert "waiting for robot_1, robot_2, robot_3, robot_4" in " ".join(shown.split())


def test_events_stand_above(node: Node, capsys: pytest.CaptureFixture[str]) -> None:
    """Events are printed above the table, in the exact words that users and scripts look for."""
    draw(node, Gate(None, 1), Event("lost", 3, "lost"), Event("go", None, "All robots GO!"))
    lines = capsys.readouterr().out.splitlines()
    assert [line for line in lines if line in ("robot_3 lost", "All robots GO!")] == ["robot_3 lost", "All robots GO!"]


@pytest.mark.parametrize("text", ["[/etc/passwd]", "[bold]x", "[link=http://x]", "\x1b[2J"])
def test_any_text_of_a_robot_is_shown_as_it_is(node: Node, capsys: pytest.CaptureFixture[str], text: str) -> None:
    """A robot's text is neither markup nor a command to the terminal."""
    gate = Gate([0], 1)
    say(gate, 0, RobotState.FAULT, text)
    draw(node, gate, *gate.members.take_events())
    shown = capsys.readouterr().out
    assert "\x1b[2J" not in shown
    assert shown.count(text.replace("\x1b", "")) >= 2
