"""What becomes of a goal, as statuses tell it."""

import math

import msgspec
import pytest

from support.goals import make_goal
from zteam.behaviors.go_to import GOAL_REACHED, NO_WAY, REFUSED
from zteam.messages import Header, NavigationState, NavigationStatus, PoseStamped, RobotStatus, Time, time_from_ns
from zteam.services.goals import SETTLED, GoalWatch, TaskResult, goal_text, status_of_go_to


def at(goal: PoseStamped, seconds: int, frame: str = "map") -> PoseStamped:
    """The goal with another stamp."""
    return msgspec.structs.replace(goal, header=Header(Time(seconds), frame))


GOAL = at(make_goal(3.0, 4.0, 0.5), 7)


def status(state: int, goal: PoseStamped = GOAL, text: str = "") -> NavigationStatus:
    """What navigation says."""
    return NavigationStatus(state=state, goal=goal, text=text)


@pytest.mark.parametrize(
    ("state", "result"),
    [
        (NavigationState.IDLE, TaskResult.UNKNOWN),
        (NavigationState.PLANNING, TaskResult.UNKNOWN),
        (NavigationState.DRIVING, TaskResult.UNKNOWN),
        (NavigationState.RECOVERING, TaskResult.UNKNOWN),
        (NavigationState.SUCCEEDED, TaskResult.SUCCEEDED),
        (NavigationState.ABORTED, TaskResult.FAILED),
        (NavigationState.CANCELED, TaskResult.CANCELED),
        (99, TaskResult.UNKNOWN),
    ],
)
def test_states_and_results(state: int, result: TaskResult) -> None:
    """Only an end ends a goal; a state of a newer version does not."""
    watch = GoalWatch(GOAL)
    watch.take(status(state, text="why"))
    assert (watch.result, watch.ended, watch.text) == (result, result != TaskResult.UNKNOWN, "why")


def test_what_is_said_of_an_older_goal_does_not_count() -> None:
    """Before navigation has taken the goal it still speaks of the one before, which may be at the same place."""
    watch = GoalWatch(GOAL)
    watch.take(status(NavigationState.SUCCEEDED, at(GOAL, 6)))
    watch.take(status(NavigationState.ABORTED, at(make_goal(1.0, 1.0), 7)))
    assert watch.status is None
    assert not watch.ended


def test_two_other_goals_replace_it_as_one_does() -> None:
    """Between two looks another sender may have sent two."""
    watch = GoalWatch(GOAL)
    for x in (1.0, 2.0):
        watch.replace(make_goal(x, 1.0))
    assert watch.is_replaced
    assert watch.result == TaskResult.FAILED
    ended = GoalWatch(GOAL)
    ended.end(TaskResult.SUCCEEDED, "")
    ended.replace(make_goal(1.0, 1.0))
    assert not ended.is_replaced


def test_a_frame_that_navigation_has_resolved_is_the_same_goal() -> None:
    """A leading slash is stripped on the way."""
    watch = GoalWatch(at(GOAL, 7, "/map"))
    watch.take(status(NavigationState.SUCCEEDED))
    assert watch.result == TaskResult.SUCCEEDED


def test_another_goal_after_this_one_is_its_end() -> None:
    """The reason has the other goal; after an end nothing counts."""
    watch = GoalWatch(GOAL)
    watch.take(status(NavigationState.DRIVING))
    watch.take(status(NavigationState.DRIVING, at(make_goal(1.0, -2.0), 8)))
    assert (watch.result, watch.text) == (TaskResult.FAILED, "another goal took its place: x 1, y -2, yaw 0")
    watch.take(status(NavigationState.SUCCEEDED))
    watch.end(TaskResult.CANCELED, "later")
    assert watch.result == TaskResult.FAILED


def test_a_navigation_that_begins_anew_has_forgotten_the_goal() -> None:
    """It was started again, or the world was reset."""
    watch = GoalWatch(GOAL)
    watch.take(status(NavigationState.DRIVING))
    watch.take(status(NavigationState.IDLE, PoseStamped()))
    assert (watch.result, watch.text) == (TaskResult.FAILED, "navigation began anew and has forgotten the goal")


@pytest.mark.parametrize(
    ("reason", "state"),
    [
        ("", NavigationState.DRIVING),
        ("an obstacle is ahead", NavigationState.DRIVING),
        (GOAL_REACHED, NavigationState.SUCCEEDED),
        (NO_WAY, NavigationState.ABORTED),
        (f"{REFUSED}it names no frame; use map", NavigationState.ABORTED),
    ],
)
def test_the_reasons_of_go_to(reason: str, state: NavigationState) -> None:
    """They are its only word of the goal; its distance is not known."""
    stamp = time_from_ns(7_000_000_000 + SETTLED)
    told = status_of_go_to(RobotStatus(Header(stamp), 1, reason=reason), GOAL)
    assert told is not None
    assert (told.state, told.goal) == (state, GOAL)
    assert math.isnan(told.distance_remaining)


def test_go_to_may_still_speak_of_the_goal_before() -> None:
    """Its status names no goal, so what it says at once does not count."""
    stamp = time_from_ns(7_000_000_000 + SETTLED - 1)
    assert status_of_go_to(RobotStatus(Header(stamp), 1, reason=GOAL_REACHED), GOAL) is None


def test_goals_as_text() -> None:
    """Without noise digits and without a negative zero; another frame than the map's is named."""
    assert goal_text(make_goal(0.1 + 0.2, -1e-9, 1.5708)) == "x 0.3, y 0, yaw 1.571"
    assert goal_text(make_goal(1.0, 2.0, 0.0, "odom")) == "x 1, y 2, yaw 0 in odom"
