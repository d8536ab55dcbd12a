"""How the motion of a robot is compared with its commands, without a bus."""

import math

from zteam.clock import to_ns
from zteam.team.chaos.observer import ON_ITS_WAY, Motion, Violation

TICK = to_ns(0.1)


def drive(motion: Motion, first: int, *speeds: float, quiet: float = math.inf) -> list[Violation]:
    """Truths of ticks from `first` on, without commands; the violations."""
    told = [motion.take_truth((first + k) * TICK, speed, quiet) for k, speed in enumerate(speeds)]
    return [found for found in told if found is not None]


def moving() -> Motion:
    """A robot that has driven for two ticks and had its last command in the second one."""
    motion = Motion("robot_1")
    drive(motion, 1, 0.5, 0.5)
    motion.commanded = 2 * TICK
    return motion


def test_a_robot_that_the_watchdog_stops_violates_nothing() -> None:
    """It may move for 0.2 s and the tick that its command was under way."""
    motion = moving()
    assert drive(motion, 3, 0.5, 0.5, 0.5, 0.0, 0.0) == []
    assert (motion.started, motion.halted, motion.moved) == (TICK, 6 * TICK, 5 * TICK)


def test_a_robot_that_moves_on_is_told() -> None:
    """Each truth in which it still moves is a violation, with the time since its last command."""
    assert drive(moving(), 3, *[0.5] * 5) == [
        Violation("robot_1", 0.6, 0.4, 0.5),
        Violation("robot_1", 0.7, 0.5, 0.5),
    ]


def test_a_robot_that_brakes_or_has_had_no_command_is_not_told() -> None:
    """A base with a limited deceleration takes its time; before the first command nothing is known."""
    assert drive(moving(), 3, 0.5, 0.5, 0.5, 0.4, 0.3, 0.2, 0.1, 0.0) == []
    assert drive(Motion("robot_1"), 1, *[0.5] * 9) == []


def test_in_real_time_a_command_may_be_on_its_way() -> None:
    """As long as a command may not have reached the simulator yet, nothing is told."""
    assert drive(moving(), 3, *[0.5] * 5, quiet=0.9 * ON_ITS_WAY) == []
    assert drive(moving(), 3, *[0.5] * 5, quiet=1.1 * ON_ITS_WAY) != []


def test_a_world_that_begins_anew_is_another_one() -> None:
    """After a reset old commands and motion do not count, and what moves there has moved since."""
    motion = moving()
    assert not motion.moved_since(0, 2 * TICK)
    assert drive(motion, 1, *[0.5] * 9) == []
    assert motion.moved_since(0, 2 * TICK) and motion.moved_since(1, 8 * TICK) and not motion.moved_since(1, 9 * TICK)
