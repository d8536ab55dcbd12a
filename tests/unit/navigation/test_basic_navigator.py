"""`zteam.BasicNavigator` with a navigation by hand: in a script, and in a node of lock-step."""

import math
from collections.abc import Callable, Iterator
from typing import Any

import pytest

import zteam
from support.fake_navigation import FakeNavigation
from support.goals import make_goal
from support.transports import wait_until_true
from zteam import TaskResult
from zteam.bus import MemoryHub
from zteam.errors import BusError, UsageError
from zteam.geometry import Pose2
from zteam.messages import NavigationState, PoseStamped, PoseWithCovarianceStamped, ns_from_time
from zteam.navigation import basic_navigator
from zteam.testing import run_node

State = NavigationState


@pytest.fixture
def navigation(hub: MemoryHub) -> FakeNavigation:
    """The navigation of robot 1."""
    return FakeNavigation(hub, 1)


@pytest.fixture
def navigator(hub: MemoryHub, navigation: FakeNavigation) -> Iterator[zteam.BasicNavigator]:
    """A navigator of robot 1 in a script, whose navigation is there."""
    bus = hub.bus()
    made = zteam.BasicNavigator(1, bus)
    navigation.say(State.IDLE)
    yield made
    bus.close()


def test_a_script_of_nav2_runs(navigator: zteam.BasicNavigator, navigation: FakeNavigation) -> None:
    """Nav2's names: wait, send a goal, look at the feedback, get the result."""
    navigator.waitUntilNav2Active()
    assert navigator.goToPose(make_goal(3.0, 4.0))
    assert not navigator.isTaskComplete()
    assert navigator.getResult() == TaskResult.UNKNOWN
    navigation.say(State.RECOVERING, left=2.5, seconds=7, recoveries=2, text="blocked")
    feedback = navigator.getFeedback()
    assert feedback is not None
    assert (feedback.distance_remaining, feedback.estimated_time_remaining.sec) == (2.5, 7)
    assert (feedback.number_of_recoveries, feedback.text) == (2, "blocked")
    assert navigator.reason == "blocked"
    navigation.say(State.SUCCEEDED)
    assert navigator.isTaskComplete()
    assert navigator.getResult() == TaskResult.SUCCEEDED == 1


def test_without_a_task_it_is_complete(navigator: zteam.BasicNavigator) -> None:
    """As in Nav2: nothing to wait for, no feedback, no result."""
    assert navigator.isTaskComplete()
    assert navigator.getFeedback() is None
    assert navigator.getResult() == TaskResult.UNKNOWN
    assert navigator.reason == ""
    navigator.cancelTask()


def test_waypoints_follow_each_other(navigator: zteam.BasicNavigator, navigation: FakeNavigation) -> None:
    """The next goal goes out when the last is reached, without a question; the feedback has its index."""
    navigator.followWaypoints([Pose2(1.0, 0.0, 0.0), make_goal(2.0, 0.0), Pose2(3.0, 0.0, 0.0)])
    for index in range(3):
        assert len(navigation.goals) == index + 1
        assert not navigator.isTaskComplete()
        feedback = navigator.getFeedback()
        assert feedback is not None
        assert feedback.current_waypoint == index
        navigation.say(State.SUCCEEDED)
    assert navigator.isTaskComplete()
    assert navigator.getResult() == TaskResult.SUCCEEDED
    assert [goal.pose.position.x for goal in navigation.goals] == [1.0, 2.0, 3.0]


def test_a_task_ends_with_the_goal_that_is_not_reached(
    navigator: zteam.BasicNavigator, navigation: FakeNavigation
) -> None:
    """No goal is sent after it. A task that is canceled stays at its waypoint; the reason is navigation's text."""
    navigator.followWaypoints([Pose2(x, 0.0, 0.0) for x in (1.0, 2.0, 3.0)])
    navigation.say(State.SUCCEEDED)
    navigation.say(State.RECOVERING)
    navigator.cancelTask()
    feedback = navigator.getFeedback()
    assert feedback is not None
    assert (feedback.current_waypoint, navigation.cancels, len(navigation.goals)) == (1, 1, 2)
    assert navigator.isTaskComplete()
    assert navigator.getResult() == TaskResult.CANCELED
    navigator.followWaypoints([Pose2(1.0, 0.0, 0.0), Pose2(2.0, 0.0, 0.0)])
    navigation.say(State.ABORTED, text="stuck")
    assert navigator.isTaskComplete()
    assert (navigator.getResult(), navigator.reason) == (TaskResult.FAILED, "stuck")
    assert len(navigation.goals) == 3


def test_a_new_goal_preempts_the_old_one(navigator: zteam.BasicNavigator, navigation: FakeNavigation) -> None:
    """What navigation says of the old goal does not count any more; equal goals are told apart."""
    navigator.goToPose(Pose2(1.0, 2.0, 0.0))
    navigator.goToPose(Pose2(1.0, 2.0, 0.0))
    first, second = navigation.goals
    assert ns_from_time(first.header.stamp) < ns_from_time(second.header.stamp)
    navigation.say(State.SUCCEEDED, goal=first)
    assert navigator.getResult() != TaskResult.SUCCEEDED


def test_the_initial_pose(hub: MemoryHub, navigator: zteam.BasicNavigator) -> None:
    """The localiser gets it with rviz's covariance: half a metre and 15 degrees."""
    heard: list[PoseWithCovarianceStamped] = []
    hub.bus().subscribe("robot_1/initialpose", PoseWithCovarianceStamped, lambda _, pose: heard.append(pose))
    navigator.setInitialPose(Pose2(1.0, 2.0, math.pi))
    (pose,) = heard
    assert (pose.header.frame_id, pose.pose.pose.position.x, pose.pose.pose.orientation.z) == ("map", 1.0, 1.0)
    assert pose.pose.covariance[[0, 7, 35]] == pytest.approx([0.25, 0.25, 0.0685], abs=1e-4)


def test_a_goal_waits_for_navigation(
    hub: MemoryHub, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without navigation the task lasts, and the log says once, later, what is missing; then the goal leaves."""
    navigator = zteam.BasicNavigator("robot_1", hub.bus())
    assert not navigator.is_active
    navigator.goToPose(Pose2(1.0, 2.0, 0.0))
    assert not navigator.isTaskComplete()
    assert caplog.records == []  # its first status is on its way
    monkeypatch.setattr(basic_navigator, "_PATIENCE", 0.0)
    assert not navigator.isTaskComplete()
    assert not navigator.isTaskComplete()
    told = "robot_1: waiting for the navigation of robot_1: start 'zteam-nav --id 1'"
    assert [record.getMessage() for record in caplog.records] == [told]
    assert navigator.reason.startswith("the navigation of robot_1")
    with pytest.raises(BusError, match=r"navigation is not there within 0\.1 s: waiting for the navigation of robot_1"):
        navigator.waitUntilNav2Active(timeout=0.1)
    navigation = FakeNavigation(hub, 1)
    navigation.say(State.IDLE)
    assert navigator.is_active
    assert [goal.pose.position.x for goal in navigation.goals] == [1.0]


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda navigator: navigator.goToPose(make_goal(math.nan, 0.0)), "a pose needs finite numbers"),
        (lambda navigator: navigator.goToPose((1.0, 2.0, 0.0)), "a pose is a PoseStamped or a Pose2, not a tuple"),
        (lambda navigator: navigator.goToPose(PoseStamped()), "and a frame, such as header.frame_id = 'map'"),
        (lambda navigator: navigator.followWaypoints([]), "give at least one pose"),
        (lambda navigator: zteam.BasicNavigator("arm_1", MemoryHub().bus()), "robot id 'arm_1' is not a whole number"),
    ],
)
def test_mistakes(navigator: zteam.BasicNavigator, make: Callable[[Any], object], text: str) -> None:
    """One line that says what to give; nothing is sent."""
    with pytest.raises(UsageError, match=text):
        make(navigator)
    assert navigator.isTaskComplete()


class Errand:
    """A node that sends a robot to two places and remembers in which step it saw what."""

    def __init__(self) -> None:
        self.seen: list[tuple[int, TaskResult]] = []
        self.navigator: Any = None
        self.failure = ""

    def __call__(self, node: zteam.Node) -> None:
        self.navigator = zteam.BasicNavigator(1, node)
        try:
            self.navigator.waitUntilNav2Active()
        except UsageError as error:
            self.failure = str(error)
        node.run(self.step)

    def step(self, now: int) -> None:
        """Begin in the first step in which navigation is there."""
        if self.navigator.is_active and not self.seen:
            self.navigator.followWaypoints([Pose2(1.0, 0.0, 0.0), Pose2(2.0, 0.0, 0.0)])
        if self.navigator.is_active:
            assert self.navigator.isTaskComplete() == (self.navigator.getResult() != TaskResult.UNKNOWN)
            self.seen.append((now, self.navigator.getResult()))


def test_in_a_node_nothing_holds_the_world(hub: MemoryHub) -> None:
    """Steps ask and go on; goals have the times of ticks, so that a run in lock-step repeats."""
    errand, navigation = Errand(), FakeNavigation(hub, 1)
    with run_node(errand, hub, name="errand") as running:
        navigation.say(State.IDLE)
        while not errand.seen:
            running.tick()
        running.tick()
        for _ in range(2):
            navigation.say(State.SUCCEEDED)
            running.tick()
            running.tick()
    assert errand.failure.startswith("waitUntilNav2Active would hold the world")
    assert errand.seen[-1][1] == TaskResult.SUCCEEDED
    first = errand.seen[0][0]
    assert [ns_from_time(goal.header.stamp) - first for goal in navigation.goals] == [0, 200_000_000]


def test_in_a_node_a_task_is_canceled_on_another_thread(hub: MemoryHub) -> None:
    """`cancelTask` in a step does not wait for the answer."""
    errand = Errand()
    navigation = FakeNavigation(hub, 1)
    with run_node(errand, hub, name="errand") as running:
        navigation.say(State.IDLE)
        while not errand.seen:
            running.tick()
        with running.node.changed:
            errand.navigator.cancelTask()
        wait_until_true(lambda: navigation.cancels == 1)
        running.tick()
        running.tick()
    assert errand.navigator.getResult() == TaskResult.CANCELED
