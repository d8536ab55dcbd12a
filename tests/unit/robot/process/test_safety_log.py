"""The safety layer's lines in the robot's log, and the count of its stops."""

import numpy as np

from support.log_capture import captured_log
from zteam.behaviors import View
from zteam.messages import LaserScan, RobotDriver, Twist, Vector3
from zteam.reasons import Cause, Reason
from zteam.robot.process.driver import FREE_AFTER, SafetyLog

TICK = 100_000_000
OBSTACLE = Reason("obstacle ahead", cause=Cause.OBSTACLE_AHEAD)


def view(now: int, distance: float) -> View:
    """A view with something straight ahead at `distance`."""
    ranges = np.full(31, 9.0, np.float32)
    ranges[15] = distance
    scan = LaserScan(angle_min=-1.5, angle_max=1.5, angle_increment=0.1, range_max=30.0, ranges=ranges)
    return View(now=now, dt=0.1, robot_id=1, scan=scan, odom=None, lookup=lambda target, source: None)


def test_one_line_when_it_stops_and_one_when_the_way_is_free() -> None:
    """The first names the behaviour, its command and the obstacle's distance; the second comes once."""
    safety = SafetyLog("forward")
    with captured_log() as log:
        for tick in range(1, 30):
            safety.take(RobotDriver.BEHAVIOR, Twist(Vector3(0.4)), OBSTACLE, view(tick * TICK, 0.31))
        assert log.lines == ["safety: stopped forward (0.40 m/s): obstacle 0.31 m ahead of the laser"]
        # It turns away: nothing is known of the way ahead of it.
        for tick in range(30, 60):
            safety.take(RobotDriver.BEHAVIOR, Twist(angular=Vector3(z=1.0)), "", view(tick * TICK, 9.0))
        assert len(log.lines) == 1
        for tick in range(60, 90):
            safety.take(RobotDriver.BEHAVIOR, Twist(Vector3(0.4)), "", view(tick * TICK, 9.0))
        assert log.lines[1:] == ["safety: the way is free again after 5.9 s"]
        safety.take(RobotDriver.BEHAVIOR, Twist(Vector3(0.4)), OBSTACLE, view(90 * TICK, 0.31))
    assert safety.stops == 2


def test_a_stop_that_comes_and_goes_is_one_stop() -> None:
    """At the edge every other step may be stopped; the log has one line until the way stays free."""
    safety = SafetyLog("forward")
    with captured_log() as log:
        for tick in range(1, 200):
            safety.take(
                RobotDriver.BEHAVIOR, Twist(Vector3(0.4)), OBSTACLE if tick % 3 else "", view(tick * TICK, 0.34)
            )
        assert len(log.lines) == 1
        assert safety.stops == 1
        assert FREE_AFTER > 3 * TICK


def test_a_robot_that_is_slowed_and_then_stopped() -> None:
    """Each has its line, and both are one stop: the second line says what stands where no laser looks."""
    safety = SafetyLog("path")
    with captured_log() as log:
        for tick in range(1, 9):
            cause = Reason("no laser looks behind", cause=Cause.UNSEEN) if tick < 5 else "robot_2 behind"
            safety.take(RobotDriver.TELEOP, Twist(Vector3(-0.4)), cause, view(tick * TICK, 9.0))
    assert log.lines == [
        "safety: slowed teleop (-0.40 m/s): no laser looks behind",
        "safety: stopped teleop (-0.40 m/s): robot_2 behind",
    ]
    assert safety.stops == 1


def test_other_causes_are_told_in_their_own_words() -> None:
    """A blind robot has no distance to tell."""
    with captured_log() as log:
        SafetyLog("wander").take(RobotDriver.BEHAVIOR, Twist(Vector3(0.2)), "blind ahead", view(TICK, 0.2))
        assert log.lines == ["safety: stopped wander (0.20 m/s): blind ahead"]
