"""Goals of several robots at one place, and which goal of a robot is its newest."""

import itertools
import json
import math
from types import SimpleNamespace
from typing import Any

import pytest

from zteam.geometry import Pose2
from zteam.messages import Header, NavigationState, NavigationStatus, Point, Pose, PoseStamped, time_from_ns
from zteam.view import documents
from zteam.view.commands import SPACING, spread
from zteam.view.documents import Documents, newest_goal
from zteam.view.received import Arrival, Received

GOAL = Pose2(5.0, 5.0, 0.3)


def test_several_robots_stand_apart_around_it() -> None:
    """Each has room and the heading, ways do not cross, and one has the goal itself, also where that lies in a wall."""
    poses = {i: Pose2(9.0 if i % 2 else -9.0, float(i), 0.0) for i in range(7)}
    goals = spread(GOAL, poses)
    apart = [math.dist(a[:2], b[:2]) for a, b in itertools.combinations(goals.values(), 2)]
    assert min(apart) > SPACING - 1e-9
    assert max(math.dist(goal[:2], GOAL[:2]) for goal in goals.values()) < SPACING + 1e-9
    assert {round(goal.yaw, 9) for goal in goals.values()} == {0.3}
    assert GOAL[:2] in [goal[:2] for goal in goals.values()]
    assert min(goals[i].x for i in (1, 3, 5)) > min(goals[i].x for i in (0, 2, 4, 6))
    assert spread(GOAL, {3: Pose2(0.0, 0.0, 0.0)}, lambda _x, _y: False) == {3: GOAL}
    beside = spread(GOAL, dict.fromkeys(range(5), GOAL), lambda x, _y: x < GOAL.x - 0.1)
    assert sum(goal.x >= GOAL.x - 0.1 for goal in beside.values()) == 1


def told(number: int, stamp: float, goal: PoseStamped, state: NavigationState) -> Arrival:
    """A status that came as message `number`."""
    status = NavigationStatus(Header(time_from_ns(int(stamp * 1e9))), int(state), goal)
    return Arrival("robot_0/navigation/status", status, number, 0.0)


def goal_at(x: float, stamp: float) -> PoseStamped:
    """A goal that was sent at `stamp` (s)."""
    return PoseStamped(Header(time_from_ns(int(stamp * 1e9)), "map"), Pose(Point(x)))


def test_the_newest_goal_is_the_one_that_was_sent_until_its_robot_speaks_of_it() -> None:
    """A status about the goal before counts no more, unless it comes long after; one of a robot that forgot is none."""
    old, new = goal_at(1.0, 5.0), goal_at(2.0, 20.0)
    sent = Arrival("robot_0/goal_pose", new, 10, 0.0)
    driving, idle = NavigationState.DRIVING, NavigationState.IDLE
    assert newest_goal(None, None) is None
    assert newest_goal(sent, None) == (new, None)
    assert newest_goal(sent, told(9, 19.0, old, driving)) == (new, None)
    assert newest_goal(sent, told(11, 20.1, old, NavigationState.SUCCEEDED)) == (new, None)
    for found in (newest_goal(sent, told(11, 20.1, new, driving)), newest_goal(None, told(1, 20.1, new, driving))):
        assert found is not None
        assert (found[0], found[1] and found[1].state) == (new, driving)
    later = newest_goal(sent, told(11, 22.0, old, driving))
    assert later is not None
    assert later[0] == old
    assert newest_goal(sent, told(11, 22.0, PoseStamped(), idle)) is None


def test_a_goal_ends_with_the_process_that_drives_to_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """Not at once: a router that ends takes all presence along for a while."""
    received, alive = Received(lambda: None), {"robot_0"}
    queries = SimpleNamespace(alive=alive.__contains__, speaks=alive.__contains__, sim=None)
    places = SimpleNamespace(pose_of=lambda _frame: Pose2(0.0, 0.0, 0.0))
    state: Any = SimpleNamespace(received=received, queries=queries, places=places, robots=lambda: {0})
    shown = Documents(state)
    status = told(1, 20.0, goal_at(1.0, 5.0), NavigationState.DRIVING).content
    assert isinstance(status, NavigationStatus)
    status.header.frame_id, status.distance_remaining = "robot_0", 3.21
    received.take("robot_0/navigation/status", status)

    def look(now: float) -> tuple[str, float | None, str]:
        monkeypatch.setattr(documents, "monotonic", lambda: now)
        [row] = json.loads(shown.goals())
        return row["state"], row["distance"], row["text"]

    assert look(0.0) == ("driving", 3.2, "")
    alive.clear()
    assert look(1.0)[0] == look(3.0)[0] == "driving"
    assert look(5.0)[::2] == ("aborted", "the process robot_0 is gone")
    alive.add("robot_0")
    assert look(6.0)[0] == "driving"
