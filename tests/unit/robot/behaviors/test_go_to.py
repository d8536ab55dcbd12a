"""go_to: a goal from outside, reached by the laser alone."""

import math

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from support.flat_floor import BEAMS, FOV, ORIGIN, TICK, box, clearance, make_scan, make_view
from support.goals import GoalFloor, make_goal
from zteam.behaviors import Behavior, View, load_behavior
from zteam.geometry import Pose2
from zteam.messages import Duration, Header, NavigationState, Pose, PoseStamped, Quaternion, Twist


def run(floor: GoalFloor, behavior: Behavior, seconds: float) -> float:
    """Drive robot 0 until it says why it stands; the least room that it had."""
    room = math.inf
    for _ in range(round(seconds * 10)):
        floor.step([behavior])
        room = min(room, clearance(floor.poses[0], floor.walls))
        if behavior.reason:
            break
    return room


def seeing(goal: PoseStamped | None, own: Pose2 | None = ORIGIN, others: dict[str, Pose2] | None = None) -> View:
    """A view with a free scan, a goal, the own pose, and the poses of other frames in map."""
    known = {"robot_0/base_footprint": own, **(others or {})}

    def lookup(target: str, source: str) -> tuple[Pose2, int] | None:
        assert target == "map"
        pose = known.get(source)
        return None if pose is None else (pose, TICK)

    view = make_view(make_scan([30.0] * 271), lookup=lookup)
    return msgspec.structs.replace(view, inputs={"goal": goal})


def go_to(**params: float) -> Behavior:
    """The behaviour of robot 0."""
    return load_behavior("go_to", params, 0)


def test_it_says_what_becomes_of_its_goal() -> None:
    """As navigation does: on the way, there, refused, or given up when it is asked to."""
    behavior = go_to()
    assert behavior.navigation is not None
    told = behavior.navigation
    assert (told.state, told.text, behavior.cancel_goal()) == (NavigationState.IDLE, "no goal yet", False)
    goal = make_goal(3.0, 4.0)
    behavior.step(seeing(goal))
    assert (told.state, told.goal, told.distance_remaining, told.text) == (NavigationState.DRIVING, goal, 5.0, "")
    # At 0.4 m/s.
    assert told.estimated_time_remaining == Duration(12, 500_000_000)
    assert behavior.cancel_goal()
    assert behavior.step(seeing(goal)) == Twist()
    assert (told.state, told.text) == (NavigationState.CANCELED, "its goal is canceled")
    assert not behavior.cancel_goal()
    for goal, state in (
        (make_goal(1.0, 0.0), NavigationState.DRIVING),
        (make_goal(0.0, 0.0), NavigationState.SUCCEEDED),
        (make_goal(1.0, 0.0, 0.0, "odm"), NavigationState.ABORTED),
    ):
        behavior.step(seeing(goal))
        assert (told.state, told.goal) == (state, goal)
    assert "'odm'" in told.text


@pytest.mark.parametrize("yaw", [0.0, 1.0, math.pi, -2.0])
def test_a_goal_is_reached_within_its_tolerances(yaw: float) -> None:
    """It stops within the tolerances of place and heading, says so and stays; Nav2's names change them."""
    for xy, turn in ((0.25, 0.25), (0.05, 0.03)):
        floor = GoalFloor([ORIGIN], [], make_goal(2.0, 1.0, yaw))
        behavior = go_to(xy_goal_tolerance=xy, yaw_goal_tolerance=turn)
        run(floor, behavior, 30.0)
        distance, left = floor.left()
        assert behavior.reason == "goal reached"
        assert distance <= xy
        assert abs(left) <= turn
        there = floor.poses[0]
        run(floor, behavior, 0.5)
        assert floor.poses[0] == there


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_it_keeps_the_side_to_which_it_turns(side: float) -> None:
    """A goal behind that is now a little to the left and now to the right is turned to on the first of the sides."""
    behavior, told = go_to(), []
    for i in range(20):
        own = Pose2(0.0, 0.0, -side * 0.3 * (-1) ** i)
        told.append(behavior.step(seeing(make_goal(-3.0, 0.0), own)).angular.z)
    assert told[0] == pytest.approx(-side) or told[0] == pytest.approx(side)
    assert told == [told[0]] * 20


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_in_a_box_it_says_so(side: float) -> None:
    """Where it turns all round and no way is wide enough, its status tells it, and that it goes on looking."""
    floor, behavior = GoalFloor([ORIGIN], box(-0.5, -0.5, 0.5, 0.5), make_goal(0.0, 3.0 * side)), go_to()
    for _ in range(200):
        floor.step([behavior])
    assert behavior.reason == "boxed in: it finds no way that is wide enough"


def test_a_goal_that_is_repeated_counts_once_on_the_way_and_anew_at_the_goal() -> None:
    """The same goal ten times a second is reached; sent again to a robot that was moved away it is driven to again."""
    floor = GoalFloor([ORIGIN], [], None)
    behavior = go_to()
    for _ in range(200):
        floor.goals = [make_goal(4.0, 0.3)]
        floor.step([behavior])
    assert floor.left()[0] <= 0.25
    floor.place(0, Pose2(3.0, 2.0, 0.0))
    floor.step([behavior])
    assert behavior.reason == "goal reached"
    floor.goals = [make_goal(4.0, 0.3)]
    run(floor, behavior, 40.0)
    assert floor.left()[0] <= 0.25


@pytest.mark.parametrize(
    ("goal", "text"),
    [
        (make_goal(math.nan, 0.0), "not finite"),
        (make_goal(0.0, math.inf), "not finite"),
        (make_goal(1.0, 0.0, math.nan), "not finite"),
        (make_goal(1e9, 0.0), "too far away"),
        (make_goal(1.0, 0.0, frame="odoom"), "in the frame 'odoom', from which no transform leads to map"),
        (PoseStamped(Header(frame_id="map"), Pose(orientation=Quaternion(w=0.0))), "its orientation is no rotation"),
    ],
)
def test_a_bad_goal_moves_nothing(goal: PoseStamped, text: str) -> None:
    """It is refused with its reason, also on the way to another goal, which is forgotten."""
    behavior = go_to()
    assert behavior.step(seeing(make_goal(3.0, 0.0))).linear.x > 0.0
    assert behavior.step(seeing(goal)) == Twist()
    assert text in behavior.reason
    assert behavior.step(seeing(goal)) == Twist()


def test_a_goal_in_another_frame_is_taken_to_the_map_once() -> None:
    """A goal in a frame that moves lies where it was when the goal came; a leading slash is dropped."""
    behavior, other = go_to(), {"robot_1/base_footprint": Pose2(0.0, 2.0, 0.0)}
    goal = make_goal(1.0, 0.0, frame="/robot_1/base_footprint")
    # A quaternion that is not normalised is an orientation.
    goal.pose.orientation.w = 3.0
    assert behavior.step(seeing(goal, others=other)).angular.z == pytest.approx(1.0)
    moved = {"robot_1/base_footprint": Pose2(50.0, -20.0, 0.0)}
    behavior.step(seeing(goal, Pose2(1.0, 2.0, 0.0), moved))
    assert behavior.reason == "goal reached"


@given(
    ranges=st.lists(st.floats(0.0, 40.0) | st.just(math.nan), min_size=BEAMS // 20, max_size=BEAMS // 20),
    goals=st.lists(st.tuples(st.floats(), st.floats(), st.floats(-1e3, 1e3)), min_size=1, max_size=3),
    own=st.tuples(st.floats(-1e3, 1e3), st.floats(-1e3, 1e3), st.floats(-math.pi, math.pi)),
)
def test_its_commands_are_finite_and_within_its_limits(
    ranges: list[float], goals: list[tuple[float, float, float]], own: tuple[float, float, float]
) -> None:
    """Any scan, any goals: speed within 0 and `speed`, turn within `max_angular`."""
    behavior = go_to(speed=0.3, max_angular=0.7)
    for goal in goals:
        view = msgspec.structs.replace(seeing(make_goal(*goal), Pose2(*own)), scan=make_scan(ranges, fov=FOV))
        for _ in range(3):
            command = behavior.step(view)
            assert 0.0 <= command.linear.x <= 0.3
            assert abs(command.angular.z) <= 0.7
