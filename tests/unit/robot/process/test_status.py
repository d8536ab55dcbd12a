"""What the robot says of itself: its status, and why nothing comes for it."""

from collections.abc import Callable

import pytest

from support.limits import LIMIT
from support.log_capture import captured_log
from support.real_time_robot import RealTimeRobot
from support.transports import wait_until_true
from zteam.behaviors import Behavior, View
from zteam.messages import RobotDriver, RobotState, TeamStatus, Twist, Vector3
from zteam.node import node as node_module
from zteam.robot.behaviors.follow import Follow
from zteam.robot.behaviors.straight import Idle
from zteam.robot.process import node as robot_module


class Asks(Behavior):
    """Wants what the test wants."""

    wanted = Twist()

    def step(self, view: View) -> Twist:
        """That velocity."""
        return Asks.wanted


class EveryBeat:
    """Instead of `Every`: a heartbeat in each round of the main loop."""

    def __init__(self, period: float) -> None:
        pass

    def due(self) -> bool:
        """Always."""
        return True

    def left(self) -> float:
        """Long: rounds come from looks at whether data has stopped."""
        return LIMIT


class NoBeat(EveryBeat):
    """Instead of `Every`: no heartbeat at all."""

    def due(self) -> bool:
        """Never."""
        return False


@pytest.fixture
def wants(monkeypatch: pytest.MonkeyPatch) -> Callable[[float, float], None]:
    """Sets the velocity that the behaviour wants: m/s, rad/s."""

    def want(speed: float, turn: float = 0.0) -> None:
        monkeypatch.setattr(Asks, "wanted", Twist(Vector3(speed), Vector3(z=turn)))

    return want


def tick_to(robot: RealTimeRobot, first: int, last: int, distance: float = 9.0) -> None:
    """Scans with an obstacle at `distance`, each answered by a command."""
    for tick in range(first, last + 1):
        robot.say_time(tick)
        robot.say_scan(tick, distance)
        robot.wait_for_commands(tick)


def test_it_says_what_drives_it_and_why_it_stands(wants: Callable[..., None], monkeypatch: pytest.MonkeyPatch) -> None:
    """Behaviour, driver, speed and reason follow the newest command; the old text stays what it was."""
    monkeypatch.setattr(node_module, "Every", EveryBeat)
    robot = RealTimeRobot(Asks)
    try:
        before = robot.wait_for_status(lambda status: True)
        assert (before.behavior, before.driver, before.leader) == ("Asks", RobotDriver.NONE, -1)
        for tick, (speed, turn, reason) in enumerate(
            [(0.4, 0.0, ""), (0.0, 0.7, ""), (-0.1, 0.0, ""), (0.0, 0.0, "the behaviour commands zero velocity")], 1
        ):
            wants(speed, turn)
            tick_to(robot, tick, tick)
            said = robot.wait_for_status(lambda status, due=(speed, reason): (status.speed, status.reason) == due)  # type: ignore[misc]
            assert (said.driver, said.state, said.text) == (RobotDriver.BEHAVIOR, RobotState.RUNNING, "")
        wants(0.4)
        tick_to(robot, 5, 5, distance=0.3)
        said = robot.wait_for_status(lambda status: status.reason == "obstacle ahead")
        assert (said.speed, said.text) == (0.0, "obstacle ahead")
    finally:
        robot.close()
    robot.halt()
    assert (robot.said[-1].driver, robot.said[-1].reason, robot.said[-1].speed) == ("none", "stopped", 0.0)


def test_a_shipped_behaviour_says_why_it_stands(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its own word is in the status, and neither in the text nor a line of the log."""
    monkeypatch.setattr(node_module, "Every", EveryBeat)
    robot = RealTimeRobot(Idle)
    try:
        with captured_log() as log:
            tick_to(robot, 1, 3)
            said = robot.wait_for_status(lambda status: status.driver == RobotDriver.BEHAVIOR)
        assert (said.reason, said.text) == ("idle: only teleop or navigation drives it", "")
        assert log.count("idle") == 0
    finally:
        robot.close()


class LooksUp(Behavior):
    """Looks transforms up, and does not say so."""

    def step(self, view: View) -> Twist:
        """By the robot before it."""
        view.base_from_robot(0)
        return Twist()


class LooksAtTeammates(Behavior):
    """Those come with their age."""

    def step(self, view: View) -> Twist:
        """By any robot."""
        return Twist(Vector3(0.1 * len(view.teammates)))


@pytest.mark.parametrize(("kind", "lines"), [(LooksUp, 1), (LooksAtTeammates, 0), (Idle, 0), (Follow, 0)])
def test_undeclared_look_ups_are_named_once(kind: type[Behavior], lines: int) -> None:
    """In one line; teammates need no declaration, and what the safety layer looks up is not the behaviour's."""
    with captured_log() as log:
        robot = RealTimeRobot(kind)
        try:
            robot.say_statics()
            robot.say_transforms(1)
            tick_to(robot, 1, 5)
        finally:
            robot.close()
    assert log.count("looks transforms up") == lines
    assert log.count(f"{kind.__name__} looks transforms up without 'uses_tf = True'") == lines


def test_a_robot_without_a_simulator_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    """It may be a real one, too: then its base sends no scan. With the first scan that is over."""
    monkeypatch.setattr(node_module, "Every", EveryBeat)
    robot = RealTimeRobot(Idle, gate=True)
    lacks = ": no simulator runs yet (zteam-sim WORLD), and no base sends data"
    try:
        said = robot.wait_for_status(lambda status: status.reason.endswith(lacks))
        assert said.text == said.reason
        assert said.text.startswith("waiting for a first scan (robot_1/base_scan), odometry (robot_1/odom)")
        robot.say_scan(1)
        robot.wait_for_status(
            lambda status: status.text.startswith("waiting for odometry (robot_1/odom)") and lacks not in status.text
        )
    finally:
        robot.close()


def test_a_robot_without_a_gate_says_that_no_simulator_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    """It has no status to wait in, so the log says it, once."""
    monkeypatch.setattr(node_module, "Every", EveryBeat)
    line = "waiting for a first scan: no simulator runs yet (zteam-sim WORLD), and no base sends data"
    with captured_log() as log:
        robot = RealTimeRobot(Idle, gate=False)
        try:
            wait_until_true(lambda: line in log.lines)
        finally:
            robot.close()
    assert log.lines.count(line) == 1


def test_a_follower_names_its_leader() -> None:
    """The leader is in the status from the start."""
    robot = RealTimeRobot()
    try:
        assert robot.wait_for_status(lambda status: True).leader == 0
    finally:
        robot.close()


def test_a_new_speed_is_no_reason_to_publish(wants: Callable[..., None], monkeypatch: pytest.MonkeyPatch) -> None:
    """Speeds that change with every tick go out with the heartbeat alone."""
    monkeypatch.setattr(node_module, "Every", NoBeat)
    robot = RealTimeRobot(Asks)
    try:
        wants(0.1)
        tick_to(robot, 1, 1)
        robot.wait_for_status(lambda status: status.state == RobotState.RUNNING)
        before = robot.statuses
        for tick in range(2, 30):
            wants(0.1 + 0.001 * tick)
            tick_to(robot, tick, tick)
        assert robot.statuses == before
    finally:
        robot.close()


@pytest.mark.gate
@pytest.mark.parametrize("gate", [True, False])
def test_a_robot_that_the_world_lacks_says_so(monkeypatch: pytest.MonkeyPatch, gate: bool) -> None:
    """Which robots the world has, and how to add this one; once it has come, what else is missing."""
    monkeypatch.setattr(node_module, "Every", EveryBeat)
    robot = RealTimeRobot(gate=gate)
    lacks = "robot_1 is not in the world; it has 0, 3-5 ('zteam sim spawn --id 1 --pose X Y YAW' adds it)"
    try:
        robot.say_world(0, 3, 4, 5)
        for tick in () if gate else range(50, 80):
            # It steps as time goes on without a scan.
            robot.say_time(tick)
            robot.wait_for_status(lambda status, count=robot.statuses: robot.statuses > count)  # type: ignore[misc]
        said = robot.wait_for_status(lambda status: lacks in status.reason)
        assert said.text == said.reason == (f"waiting for its first scan: {lacks}" if gate else lacks)
        if gate:
            robot.say_scan(51)
            robot.wait_for_status(lambda status: status.text.startswith("waiting for odometry (robot_1/odom)"))
    finally:
        robot.close()


def test_a_robot_that_was_taken_out_of_the_world_says_so(
    wants: Callable[..., None], monkeypatch: pytest.MonkeyPatch
) -> None:
    """While it runs, too: its scans have become stale because the world no longer has it."""
    monkeypatch.setattr(node_module, "Every", EveryBeat)
    robot = RealTimeRobot(Asks)
    try:
        wants(0.4)
        tick_to(robot, 1, 3)
        robot.wait_for_status(lambda status: status.speed == 0.4)
        robot.say_world(0)
        for tick in range(50, 80):
            robot.say_time(tick)
            robot.wait_for_status(lambda status, count=robot.statuses: robot.statuses > count)  # type: ignore[misc]
        robot.wait_for_status(lambda status: status.reason.startswith("robot_1 is not in the world; it has 0 ("))
        robot.say_scan(80)
        robot.wait_for_status(lambda status: status.reason == "" and status.speed == 0.4)
    finally:
        robot.close()


def test_a_robot_without_any_data_says_what_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    """Also before the first scan or tick, when there is no turn to take."""
    monkeypatch.setattr(node_module, "Every", EveryBeat)
    robot = RealTimeRobot(gate=True)
    try:
        robot.wait_for_status(lambda status: status.text.startswith("waiting for a first scan (robot_1/base_scan)"))
    finally:
        robot.close()


@pytest.mark.gate
def test_a_ready_robot_tells_whom_go_waits_for(monkeypatch: pytest.MonkeyPatch) -> None:
    """What the monitor waits for is in its log once, when it has been ready for a while, and again when it changes."""
    monkeypatch.setattr(node_module, "Every", EveryBeat)
    monkeypatch.setattr(robot_module, "_TELL_EVERY", 2)
    with captured_log() as log:
        robot = RealTimeRobot(Asks, gate=True)
        try:
            robot.say_team(TeamStatus(waiting_for="robot_2: no process yet"))
            robot.say_base_info()
            robot.say_statics()
            robot.say_odometry(1)
            robot.say_transforms(1)
            robot.say_time(1)
            robot.say_scan(1)
            log.wait_for("ready; GO waits for robot_2: no process yet")
            seen = robot.statuses
            robot.say_team(TeamStatus(waiting_for="robot_2: waiting for a first scan"))
            log.wait_for("ready; GO waits for robot_2: waiting for a first scan")
            assert robot.statuses > seen
            assert log.count("no process yet") == 1
        finally:
            robot.close()
