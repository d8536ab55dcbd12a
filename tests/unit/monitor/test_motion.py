"""How the motion of a robot follows from ground truth and commands, without a bus."""

import pytest

from zteam.clock import to_ns
from zteam.messages import Odometry, Twist, Vector3, time_from_ns
from zteam.monitor.motion import Motion

TICK = to_ns(0.1)


def drive(motion: Motion, first: int, *speeds: float) -> list[int]:
    """Truths of ticks from `first` on, without commands; how many ticks the robot was silent at each."""
    silent = []
    for k, speed in enumerate(speeds):
        truth = Odometry()
        truth.header.stamp, truth.twist.twist = time_from_ns((first + k) * TICK), Twist(Vector3(speed))
        motion.take_truth(truth)
        silent.append(motion.silent // TICK)
    return silent


def moving() -> Motion:
    """A robot that has driven for two ticks and had its last command in the second one."""
    motion = Motion()
    drive(motion, 1, 0.5, 0.5)
    motion.take_command(2 * TICK, 0.0)
    return motion


def test_the_times_of_a_drive() -> None:
    """Since when it moved, when it moved last, and since when it stands; a robot that stands is never silent."""
    motion = moving()
    assert drive(motion, 3, 0.5, 0.5, 0.5, 0.0, 0.0) == [1, 2, 3, 0, 0]
    assert (motion.started, motion.halted, motion.moved) == (TICK, 6 * TICK, 5 * TICK)


def test_a_robot_that_brakes_or_has_had_no_command_is_not_silent() -> None:
    """A base with a limited deceleration takes its time; before the first command nothing is known."""
    assert drive(moving(), 3, 0.5, 0.4, 0.3, 0.2, 0.1, 0.0) == [1, 0, 0, 0, 0, 0]
    assert drive(Motion(), 1, *[0.5] * 9) == [0] * 9


def test_a_world_that_begins_anew_is_another_one() -> None:
    """After a reset old commands and motion do not count, and what moves there has moved since."""
    motion = moving()
    assert not motion.moved_since(0, 2 * TICK)
    assert drive(motion, 1, *[0.5] * 9) == [0] * 9
    assert motion.moved_since(0, 2 * TICK) and motion.moved_since(1, 8 * TICK) and not motion.moved_since(1, 9 * TICK)


def test_the_distance_counts_from_the_first_truth_of_a_world() -> None:
    """A robot that was away drove nothing meanwhile: its first velocity after that holds for one tick."""
    motion = Motion()
    for first, speeds in ((1, (1.0, 1.0)), (50, (1.0, 1.0))):
        drive(motion, first, *speeds)
    assert motion.distance == pytest.approx(0.3)
    drive(motion, 1, 1.0)
    assert motion.distance == 0.0
