"""A robot in real time when time jumps back, and when its behaviour fails."""

import threading
from collections.abc import Iterator
from typing import ClassVar

import pytest

from support.limits import LIMIT
from support.real_time_robot import NEVER, TICK, RealTimeRobot
from zteam.behaviors import Behavior, View
from zteam.messages import Twist, Vector3
from zteam.robot.behaviors.behavior import ask
from zteam.robot.process import driver
from zteam.robot.process import node as robot_module


class Watched(Behavior):
    """Notes the ticks of its views, and whether it is made anew while it steps. Its first step waits for `release`."""

    made = 0
    stepping = False
    overlaps = 0
    ticks: ClassVar[list[int]] = []
    entered: ClassVar[threading.Event]
    release: ClassVar[threading.Event]

    def __init__(self, params: object) -> None:
        super().__init__(params)
        Watched.made += 1
        Watched.overlaps += Watched.stepping

    def step(self, view: View) -> Twist:
        """A velocity that tells which tick it is for."""
        Watched.stepping = True
        Watched.ticks.append(view.now // TICK)
        Watched.entered.set()
        Watched.release.wait(LIMIT)
        Watched.stepping = False
        return Twist(Vector3(0.001 * Watched.ticks[-1]))


@pytest.fixture
def watched(monkeypatch: pytest.MonkeyPatch) -> type[Watched]:
    """Fresh notes."""
    for name, value in {"made": 0, "stepping": False, "overlaps": 0, "ticks": []}.items():
        monkeypatch.setattr(Watched, name, value)
    for name in ("entered", "release"):
        monkeypatch.setattr(Watched, name, threading.Event(), raising=False)
    return Watched


@pytest.fixture
def interrupted(watched: type[Watched]) -> Iterator[RealTimeRobot]:
    """A robot that still steps for tick 50 while time jumps back to tick 1."""
    robot = RealTimeRobot(watched)
    try:
        robot.say_statics()
        # The scan first: after half a second without one the robot acts, to stop.
        robot.say_scan(50)
        robot.say_time(50)
        assert watched.entered.wait(LIMIT)
        robot.say_time(1)
        robot.say_scan(1)
        yield robot
    finally:
        watched.release.set()
        robot.close()


def test_a_behaviour_is_not_made_anew_while_it_steps(interrupted: RealTimeRobot, watched: type[Watched]) -> None:
    """A jump back in the middle of a step is taken after it; the behaviour is made anew before the next step."""
    assert watched.made == 1
    watched.release.set()
    interrupted.wait_for_commands(2)
    assert (watched.made, watched.overlaps, watched.ticks[:2]) == (2, 0, [50, 1])


def drive_at_tick_50(robot: RealTimeRobot) -> None:
    """Give it all that it needs in that tick, and wait for its command."""
    robot.say_statics()
    robot.say_transforms(50)
    # Before the time: after half a second without a scan the robot acts, to stop.
    robot.say_scan(50)
    robot.say_time(50)
    robot.wait_for_commands(1)


def test_nothing_of_the_old_time_is_done_after_a_jump(monkeypatch: pytest.MonkeyPatch) -> None:
    """A robot that waits for the transforms of a scan when time jumps back does not act on that scan any more."""
    ticks: list[int] = []

    def note(behavior: Behavior, view: View) -> tuple[Twist, str]:
        ticks.append(view.now // TICK)
        return ask(behavior, view)

    monkeypatch.setattr(driver, "ask", note)
    monkeypatch.setattr(robot_module, "TF_LIMIT", NEVER)
    robot = RealTimeRobot()
    try:
        drive_at_tick_50(robot)
        # Its transforms do not come.
        robot.say_time(51)
        robot.say_scan(51)
        robot.wait_for_waiting()
        robot.say_time(1)
        robot.say_transforms(1)
        robot.say_scan(1)
        robot.wait_for_commands(2)
        assert ticks == [50, 1]
    finally:
        robot.close()


def test_a_late_bundle_of_the_old_time_is_not_that_of_the_scan(monkeypatch: pytest.MonkeyPatch) -> None:
    """The aggregator hears of a jump later than the robot; a bundle that it sends meanwhile has no part in a step."""
    monkeypatch.setattr(robot_module, "TF_LIMIT", NEVER)
    robot = RealTimeRobot()
    try:
        drive_at_tick_50(robot)
        robot.say_time(1)
        robot.say_transforms(50)
        robot.say_scan(1)
        robot.wait_for_waiting()
        robot.say_transforms(1)
        robot.wait_for_commands(2)
    finally:
        robot.close()


class Broken(Behavior):
    """Fails in `fails_in`."""

    fails_in: ClassVar[str]
    made = 0

    def __init__(self, params: object) -> None:
        super().__init__(params)
        Broken.made += 1
        if Broken.made == 2:
            self._fail("made anew")

    def _fail(self, where: str) -> None:
        if Broken.fails_in == where:
            raise ValueError(where)

    def step(self, view: View) -> Twist:
        """A velocity."""
        self._fail("step")
        return Twist()


@pytest.mark.parametrize("where", ["step", "made anew"])
def test_an_error_of_the_behaviour_ends_the_robot(monkeypatch: pytest.MonkeyPatch, where: str) -> None:
    """The main loop raises it, whether the behaviour steps or is made anew."""
    monkeypatch.setattr(Broken, "made", 0)
    monkeypatch.setattr(Broken, "fails_in", where, raising=False)
    robot = RealTimeRobot(Broken)
    try:
        robot.say_statics()
        robot.say_time(50)
        robot.say_scan(50)
        if where == "made anew":
            robot.wait_for_commands(1)
            robot.say_time(1)
            robot.say_scan(1)
        robot.join()
        assert [str(error) for error in robot.failures] == [where]
    finally:
        robot.close()
