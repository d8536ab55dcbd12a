"""`zteam stop` on a bus in memory: what it prints where, and its exit code."""

import json

import pytest

from support.named_sessions import open_named
from zteam.bus import MemoryHub
from zteam.cli import main as zteam
from zteam.cli import stop
from zteam.node.stopping import StopSwitch
from zteam.robot.client import CONFIRM_LIMIT

Captured = pytest.CaptureFixture[str]


@pytest.fixture
def robots(hub: MemoryHub, monkeypatch: pytest.MonkeyPatch) -> list[StopSwitch]:
    """Two robots that `zteam` commands find."""
    monkeypatch.setattr(stop, "open_bus", lambda _options: hub.bus())
    return [StopSwitch(open_named(hub, f"robot_{i}"), i) for i in range(2)]


def test_all_robots_are_stopped_and_released(robots: list[StopSwitch], capsys: Captured) -> None:
    """A line for each, and how they go on; people who look for the end of a team are told."""
    assert zteam.main(["stop"]) == 0
    assert [robot.is_stopped for robot in robots] == [True, True]
    assert capsys.readouterr().out.splitlines() == [
        "robot_0: stopped, confirmed by robot_0",
        "robot_1: stopped, confirmed by robot_1",
        "they stand until 'zteam stop --release' (to end a team, press Ctrl+C where 'zteam up' runs)",
    ]
    assert zteam.main(["stop", "--release", "1"]) == 0
    assert [robot.is_stopped for robot in robots] == [True, False]
    assert capsys.readouterr().out == "robot_1: released, confirmed by robot_1\n"


def test_what_does_not_confirm_is_an_error(hub: MemoryHub, robots: list[StopSwitch], capsys: Captured) -> None:
    """On standard error, with exit code 1; the others are stopped."""
    open_named(hub, "robot_4")
    assert zteam.main(["stop", "0", "4"]) == 1
    assert [robot.is_stopped for robot in robots] == [True, False]
    printed = capsys.readouterr()
    assert printed.out.startswith("robot_0: stopped")
    assert printed.err.endswith(f"robot_4: not confirmed by robot_4 within {CONFIRM_LIMIT:g} s\n")
    assert zteam.main(["stop", "--release", "--json", "0,4"]) == 1
    first, second = json.loads(capsys.readouterr().out)
    assert first == {"robot": 0, "is_stopped": False, "confirmed": ["robot_0"], "missing": [], "problem": ""}
    assert (second["robot"], second["confirmed"], second["missing"]) == (4, [], ["robot_4"])


def test_without_robots_nothing_is_stopped(hub: MemoryHub, monkeypatch: pytest.MonkeyPatch, capsys: Captured) -> None:
    """The error names the next step."""
    monkeypatch.setattr(stop, "open_bus", lambda _options: hub.bus())
    assert zteam.main(["stop"]) == 1
    assert "no robot is there" in capsys.readouterr().err
