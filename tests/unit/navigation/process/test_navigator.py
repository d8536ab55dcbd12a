"""One robot's way to its goal, with a planner and a controller that do what the test says."""

import math
from typing import NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

from support.goals import make_goal
from zteam.geometry import Pose2, Velocity
from zteam.messages import NavigationState
from zteam.messages.base import Base
from zteam.navigation.planning.controller import BlockedError
from zteam.navigation.planning.parameters import ControllerOptions, Parameters, PlannerServerOptions
from zteam.navigation.planning.planner import NoPathError, Plan
from zteam.navigation.planning.recovery import RecoveryOptions
from zteam.navigation.process.costmaps import Situation
from zteam.navigation.process.navigator import MISSING_LIMIT, STOP, Navigator, slow_down

AHEAD = Velocity(0.5)


class Maps(NamedTuple):
    """Costmaps that nothing is asked of but who they are."""

    whole: str = "whole"
    local: str = "local"

    def of_map(self) -> str:
        return "static"

    def look_far(self, _here: Situation) -> None:
        """Nothing to see."""


class Planner:
    """Plans a straight line; without a way on the costmaps that the test names."""

    def __init__(self) -> None:
        self.shut: set[str] = set()
        self.plans = 0

    def plan(self, costmap: str, start: Pose2, goal: Pose2) -> Plan:
        if costmap in self.shut:
            raise NoPathError(f"no way on {costmap}")
        self.plans += costmap == "whole"
        path = np.array([start, goal])
        return Plan(path, math.dist(start[:2], goal[:2]), 0.0)


class Controller:
    """Drives ahead, unless the test blocks it."""

    blocked = False

    def set_path(self, path: NDArray[np.float64]) -> None:
        self.path = path

    def command(self, _costmap: str, pose: Pose2, _velocity: Velocity, _seconds: float) -> Velocity:
        self.pose = pose
        if self.blocked:
            raise BlockedError("a box is in the way")
        return AHEAD

    left = 3.0

    def remaining(self) -> float:
        return self.left


class Drive:
    """A navigator with a goal 10 m ahead, and its steps."""

    def __init__(self, **options: object) -> None:
        self.planner, self.controller = Planner(), Controller()
        self.parameters = Parameters()._replace(**options)  # type: ignore[arg-type]
        self.navigator = Navigator(self.parameters, self.planner, self.controller)  # type: ignore[arg-type]
        self.now, self.pose = 0.0, Pose2(0.0, 0.0, 0.0)
        self.go(10.0)

    def go(self, x: float) -> None:
        """Send a goal."""
        self.navigator.accept(make_goal(x, 0.0), Pose2(x, 0.0, 0.0))

    def step(self, x: float | None = None, count: int = 1) -> Velocity:
        """Steps of 0.1 s; with `x` the robot is there."""
        velocity = STOP
        for _ in range(count):
            self.now += 0.1
            self.pose = self.pose if x is None else Pose2(x, 0.0, 0.0)
            if self.navigator.active:
                here = Situation(self.now, 0.1, self.pose, Pose2(0.0, 0.0, 0.0))
                velocity = self.navigator.step(here, Maps())  # type: ignore[arg-type]
        return velocity


@pytest.mark.parametrize("frequency", [1.0, 0.0])
def test_it_plans_drives_and_arrives(frequency: float) -> None:
    """A plan a second, also where a file of Nav2 expects none; within the tolerance the goal is reached, and the robot
    stands."""
    drive = Drive(planner_server=PlannerServerOptions(expected_planner_frequency=frequency))
    assert drive.step(0.0) == AHEAD
    for tick in range(1, 31):
        assert drive.step(0.05 * tick) == AHEAD
    assert drive.planner.plans == 4
    assert (drive.navigator.state, drive.navigator.distance_remaining) == (NavigationState.DRIVING, 3.0)
    assert drive.step(9.8) == STOP
    assert (drive.navigator.state, drive.navigator.distance_remaining) == (NavigationState.SUCCEEDED, 0.0)


def test_a_way_that_the_map_does_not_have_ends_at_once() -> None:
    """With the planner's reason: nothing that is done about lasers could help."""
    drive = Drive()
    drive.planner.shut = {"whole", "static"}
    assert drive.step() == STOP
    assert (drive.navigator.state, drive.navigator.text) == (NavigationState.ABORTED, "no way on static")


def test_a_way_that_something_stands_in_is_waited_for() -> None:
    """It recovers, tries again, and drives when the way is free."""
    drive = Drive()
    drive.planner.shut = {"whole"}
    drive.step(count=5)
    assert (drive.navigator.state, drive.navigator.text) == (NavigationState.RECOVERING, "no way on whole")
    drive.planner.shut = set()
    drive.step(count=25)
    assert (drive.navigator.state, drive.navigator.recoveries) == (NavigationState.DRIVING, 1)


def test_on_its_way_it_keeps_to_the_path_while_there_is_no_other() -> None:
    """Something that passes closes the way for a moment: the controller looks out for it."""
    drive = Drive()
    drive.step(0.0)
    drive.planner.shut = {"whole"}
    for tick in range(1, 30):
        assert drive.step(0.05 * tick) == AHEAD


def test_a_blocked_robot_plans_anew_and_then_recovers() -> None:
    """At once a new plan; after `failure_tolerance` the first recovery, which waits."""
    drive = Drive()
    drive.step(count=2)
    drive.controller.blocked = True
    assert drive.step() == STOP
    plans = drive.planner.plans
    drive.step()
    assert drive.planner.plans == plans + 1
    drive.step(count=4)
    assert (drive.navigator.state, drive.navigator.text) == (NavigationState.RECOVERING, "a box is in the way")


@pytest.mark.parametrize(
    ("wanted", "before", "kept"),
    [
        (Velocity(0.4, 0.0, 0.5), Velocity(0.4, 0.0, 0.5), Velocity(0.4, 0.0, 0.5)),
        (Velocity(1.0, 0.0, 0.5), Velocity(0.5, 0.0, 0.5), Velocity(0.5, 0.0, 0.25)),
        (Velocity(0.5, 0.0, 2.0), Velocity(0.5, 0.0, 1.0), Velocity(0.25, 0.0, 1.0)),
        (Velocity(-2.0), Velocity(-0.5), Velocity(-0.3)),
        (Velocity(0.5), Velocity(), Velocity(0.2)),
        (Velocity(0.5), Velocity(-0.5), Velocity(0.2)),
        (Velocity(0.0), Velocity(0.5), Velocity(0.0)),
        (Velocity(turn=-1.0), Velocity(turn=-0.2), Velocity(turn=-0.6)),
    ],
)
def test_velocities_keep_within_limits_on_their_arc(wanted: Velocity, before: Velocity, kept: Velocity) -> None:
    """Speeds and speeding up have limits in both directions, braking has none."""
    limits = Base(max_vel_x=0.5, min_vel_x=-0.3, max_vel_theta=1.0, acc_lim_x=2.0, acc_lim_theta=4.0)
    assert slow_down(wanted, before, limits, 0.1) == pytest.approx(kept)


def test_a_failure_tolerance_below_0_has_no_end() -> None:
    """As in Nav2: the controller may find no command for as long as it takes."""
    drive = Drive(controller=ControllerOptions(failure_tolerance=-1.0))
    drive.step(count=2)
    drive.controller.blocked = True
    drive.step(count=60)
    assert drive.navigator.state is NavigationState.DRIVING


def test_a_robot_that_does_not_get_on_gives_up_with_the_reason() -> None:
    """Half a metre in ten seconds is asked for; after the last recovery it says what was tried."""
    recovery = RecoveryOptions(behaviors=("wait",), number_of_retries=2)
    drive = Drive(recovery=recovery)
    drive.step(count=100)
    assert drive.navigator.state is NavigationState.DRIVING
    drive.step(count=3)
    told = "moved less than 0.5 m in 10 s"
    assert (drive.navigator.state, drive.navigator.text) == (NavigationState.RECOVERING, told)
    drive.step(count=400)
    assert drive.navigator.state is NavigationState.ABORTED
    assert drive.navigator.text == f"{told}: gave up after 2 recoveries (wait)"
    drive.go(5.0)
    drive.step()
    assert (drive.navigator.state, drive.navigator.recoveries) == (NavigationState.DRIVING, 0)


def test_a_robot_that_moves_to_and_fro_gives_up_and_one_that_gets_nearer_does_not() -> None:
    """To have moved lets it try all recoveries again a few times; to be nearer to the goal, as often as it likes."""
    recovery = RecoveryOptions(behaviors=("wait",), number_of_retries=2)
    for nearer, state in ((0.0, NavigationState.ABORTED), (0.6, NavigationState.RECOVERING)):
        drive = Drive(recovery=recovery)
        drive.controller.left = 8.0
        for number in range(7):
            drive.controller.blocked = False
            drive.step(0.6 * (number % 2), count=30)
            drive.controller.left -= nearer
            drive.step(count=2)
            drive.controller.blocked = True
            drive.step(count=6)
        assert drive.navigator.state is state
        told = "a box is in the way: gave up after 6 recoveries that brought it no nearer to the goal"
        assert (drive.navigator.text == told) == (state is NavigationState.ABORTED)


def test_what_is_missing_is_waited_for_and_then_given_up() -> None:
    """With the reason; a robot that waits for GO or is driven by hand is waited for without an end."""
    drive = Drive()
    assert drive.navigator.wait(1.0, "no scan") == STOP
    assert (drive.navigator.state, drive.navigator.text) == (NavigationState.PLANNING, "no scan")
    drive.navigator.wait(1.1 + MISSING_LIMIT, "no scan")
    assert (drive.navigator.state, drive.navigator.text) == (NavigationState.ABORTED, "no scan, for 10 s")
    drive.go(3.0)
    for now in (20.0, 60.0, 120.0):
        drive.navigator.wait(now, "waits for GO", for_ever=True)
    assert drive.navigator.state is NavigationState.PLANNING


def test_a_command_is_for_the_place_where_it_begins_to_count() -> None:
    """The command before moves the robot for one more step, on an arc."""
    drive = Drive()
    here = Situation(0.1, 0.1, Pose2(0.0, 0.0, 0.0), Pose2(0.0, 0.0, 0.0), pending=Velocity(0.5, 0.0, 1.0))
    drive.navigator.step(here, Maps())  # type: ignore[arg-type]
    assert drive.controller.pose == pytest.approx((0.05 * math.cos(0.05), 0.05 * math.sin(0.05), 0.1))
