"""`zteam stop` on a bus in memory: what it prints where, and its exit code."""

import json

import pytest

from support.commands import Run
from support.named_sessions import open_named
from zteam.bus import MemoryHub
from zteam.node.stopping import StopSwitch
from zteam.robot.client import CONFIRM_LIMIT


@pytest.fixture
def robots(tools: MemoryHub) -> list[StopSwitch]:
    """Two robots that `zteam` commands find."""
    return [StopSwitch(open_named(tools, f"robot_{i}"), i) for i in range(2)]


def test_all_robots_are_stopped_and_released(robots: list[StopSwitch], run: Run) -> None:
    """A line for each, and how they go on; people who look for the end of a team are told."""
    first, second, last = run("zteam stop").out.splitlines()
    assert [robot.is_stopped for robot in robots] == [True, True]
    assert (first, second) == tuple(f"robot_{i}: stopped, confirmed by robot_{i}" for i in range(2))
    assert "'zteam stop --release'" in last and "press Ctrl+C where 'zteam up' runs" in last
    assert run("zteam stop --release 1").out == "robot_1: released, confirmed by robot_1\n"
    assert [robot.is_stopped for robot in robots] == [True, False]


def test_what_does_not_confirm_is_an_error(tools: MemoryHub, robots: list[StopSwitch], run: Run) -> None:
    """On standard error, with exit code 1; the others are stopped."""
    open_named(tools, "robot_4")
    printed = run("zteam stop 0 4", 1)
    assert [robot.is_stopped for robot in robots] == [True, False]
    assert printed.out.startswith("robot_0: stopped")
    assert printed.err.endswith(f"robot_4: not confirmed by robot_4 within {CONFIRM_LIMIT:g} s\n")
    first, second = json.loads(run("zteam stop --release --json 0,4", 1).out)
    assert first == {"robot": 0, "is_stopped": False, "confirmed": ["robot_0"], "missing": [], "problem": ""}
    assert (second["robot"], second["confirmed"], second["missing"]) == (4, [], ["robot_4"])


@pytest.mark.usefixtures("tools")
def test_without_robots_nothing_is_stopped(run: Run) -> None:
    """The error names the next step."""
    assert "no robot is there" in run("zteam stop", 1).err
