"""What becomes of a goal, as statuses tell it; and what takes a robot's goals."""

import msgspec
import pytest

from support.fake_navigation import FakeNavigation
from support.goals import make_goal
from zteam.bus import MemoryHub
from zteam.errors import BusError
from zteam.messages import Header, NavigationState, NavigationStatus, PoseStamped, Time
from zteam.navigation import client as navigation
from zteam.navigation.client import GO_TO, NAVIGATION, GoalWatch, NavigationClient, TaskResult, goal_text
from zteam.robot.client import GONE


def at(goal: PoseStamped, seconds: int, frame: str = "map") -> PoseStamped:
    """The goal with another stamp."""
    return msgspec.structs.replace(goal, header=Header(Time(seconds), frame))


GOAL = at(make_goal(3.0, 4.0, 0.5), 7)


def status(state: int, goal: PoseStamped = GOAL, text: str = "") -> NavigationStatus:
    """What navigation says."""
    return NavigationStatus(state=state, goal=goal, text=text)


STATE = NavigationState
OTHER = at(make_goal(1.0, -2.0), 8)


@pytest.mark.parametrize(
    ("said", "result", "text"),
    [
        ([status(STATE.IDLE, text="why")], TaskResult.UNKNOWN, "why"),
        ([status(STATE.RECOVERING, text="why")], TaskResult.UNKNOWN, "why"),
        ([status(99, text="of a newer version")], TaskResult.UNKNOWN, "of a newer version"),
        ([status(STATE.SUCCEEDED)], TaskResult.SUCCEEDED, ""),
        ([status(STATE.ABORTED, text="why")], TaskResult.FAILED, "why"),
        ([status(STATE.CANCELED, text="why"), status(STATE.SUCCEEDED)], TaskResult.CANCELED, "why"),
        # Navigation still speaks of the goal before, which may be at the same place.
        ([status(STATE.SUCCEEDED, at(GOAL, 6)), status(STATE.ABORTED, OTHER)], TaskResult.UNKNOWN, ""),
        # A leading slash is stripped on the way.
        ([status(STATE.SUCCEEDED, at(GOAL, 7, "/map"))], TaskResult.SUCCEEDED, ""),
        (
            [status(STATE.DRIVING), status(STATE.DRIVING, OTHER), status(STATE.SUCCEEDED)],
            TaskResult.FAILED,
            "another goal took its place: x 1, y -2, yaw 0",
        ),
        (
            [status(STATE.DRIVING), status(STATE.IDLE, PoseStamped())],
            TaskResult.FAILED,
            "navigation began anew and has forgotten the goal",
        ),
    ],
)
def test_what_becomes_of_a_goal(said: list[NavigationStatus], result: TaskResult, text: str) -> None:
    """It lasts until navigation reports its end, another goal or nothing any more; after the end nothing counts."""
    watch = GoalWatch(GOAL)
    for each in said:
        watch.receive(each)
    assert (watch.result, watch.ended, watch.text) == (result, result != TaskResult.UNKNOWN, text)
    watch.replace(OTHER)
    assert watch.is_replaced == (result == TaskResult.UNKNOWN or "another goal" in text)
    assert watch.ended


def test_goals_as_text() -> None:
    """Without noise digits and without a negative zero; another frame than the map's is named."""
    assert goal_text(make_goal(0.1 + 0.2, -1e-9, 1.5708)) == "x 0.3, y 0, yaw 1.571"
    assert goal_text(make_goal(1.0, 2.0, 0.0, "odom")) == "x 1, y 2, yaw 0 in odom"


@pytest.fixture
def client(hub: MemoryHub) -> NavigationClient:
    """A client of robot 1."""
    return NavigationClient(hub.bus(), 1, lambda: 1)


def test_navigation_takes_goals_before_the_behaviour(hub: MemoryHub, client: NavigationClient) -> None:
    """Whichever speaks first; without navigation the behaviour takes them."""
    robot = FakeNavigation(hub, 1, go_to=True)
    robot.say(NavigationState.IDLE)
    assert (client.taker, client.lack) == (GO_TO, "")
    FakeNavigation(hub, 1).say(NavigationState.IDLE)
    assert client.taker == NAVIGATION
    robot.say(NavigationState.IDLE)
    assert client.taker == NAVIGATION


def test_a_navigation_that_runs_need_not_be_started(hub: MemoryHub, client: NavigationClient) -> None:
    """It holds its name, but says nothing: there is no simulator, or simulated time stands still."""
    assert client.lack == "the navigation of robot_1: start 'zteam-nav --id 1'"
    silent = FakeNavigation(hub, 1)
    assert client.lack == "the first status of nav_1, which runs: see 'zteam doctor'"
    FakeNavigation(hub, 1, go_to=True).say(NavigationState.IDLE)
    assert client.taker == ""
    silent.end()
    assert client.lack == "the navigation of robot_1: start 'zteam-nav --id 1'"


def test_a_process_that_stays_away_is_gone(
    hub: MemoryHub, client: NavigationClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A token that comes back in time, as after a router's end, is no loss; the end of another process is none."""
    now = [100.0]
    monkeypatch.setattr(navigation, "monotonic", lambda: now[0])
    robot, first = FakeNavigation(hub, 1, go_to=True), FakeNavigation(hub, 1)
    first.say(NavigationState.IDLE)
    watch = client.send(GOAL)
    robot.end()
    first.end()
    now[0] += GONE / 2
    second = FakeNavigation(hub, 1)
    now[0] += GONE
    client.look()
    assert (client.taker, watch.ended) == (NAVIGATION, False)
    second.end()
    now[0] += GONE
    client.look()
    assert (client.taker, watch.result, watch.text) == ("", TaskResult.FAILED, "the process nav_1 is gone")


def test_to_cancel_reaches_all_that_take_goals(hub: MemoryHub, client: NavigationClient) -> None:
    """A robot with navigation whose behaviour takes goals too stops for good."""
    with pytest.raises(BusError, match="robot_1 has no navigation"):
        client.cancel()
    both = FakeNavigation(hub, 1), FakeNavigation(hub, 1, go_to=True)
    assert not client.cancel()
    both[1].say(NavigationState.IDLE)
    both[0].say(NavigationState.IDLE)
    client.send(GOAL)
    assert client.cancel()
    assert [each.cancels for each in both] == [2, 2]
