"""How far robots are from each other over the ways that they have driven."""

import math

import pytest

from zteam.robot.behaviors.ways import Ways

BEND = {0: (0.0, 0.0), 1: (0.8, 0.0), 2: (1.6, 0.0), 3: (1.6, 0.9), 4: (0.8, 0.9)}
"""A team in a corridor that goes round a wall: the last one is nearer to the first than the one in the middle."""


def test_a_team_that_was_set_down_round_a_bend_is_in_a_row() -> None:
    """The order is the one along the corridor, and a distance is about the length of the way."""
    ways = Ways()
    ways.note(BEND)
    found = ways.row(0)
    assert list(found) == [1, 2, 3, 4]
    assert found[4] == pytest.approx(3.3, abs=0.7)


def test_the_order_is_that_of_the_ways_wherever_the_robots_drive() -> None:
    """The leader drives on until it is beside the last robot, with the wall between them: the order stays."""
    ways = Ways()
    ways.note(BEND)
    for step in range(40):
        ways.note({robot: (x - 0.05 * step if robot == 0 else x, y) for robot, (x, y) in BEND.items()})
    ways.note({**BEND, 0: (-1.9, 0.0), 4: (0.0, 0.9)})
    assert list(ways.row(0)) == [1, 2, 3, 4]


def test_a_robot_that_was_set_down_elsewhere_has_left_no_way_there() -> None:
    """Its old and its new place are joined by way of the others alone."""
    ways = Ways()
    ways.note({0: (0.0, 0.0), 1: (1.0, 0.0)})
    ways.note({0: (0.0, 0.0), 1: (0.0, 8.0)})
    assert ways.row(0)[1] == pytest.approx(8.0, abs=0.5)
    ways.note({0: (0.0, 0.0), 1: (1.0, 0.0)})
    assert ways.row(0)[1] == pytest.approx(1.0, abs=0.5)


def test_what_was_noted_between_walls_is_found_beside_it_too() -> None:
    """At the place and up to a cell from it, and also after other robots have come by."""
    ways = Ways()
    ways.note({0: (0.0, 0.0)})
    ways.note_walls((0.0, 0.0))
    ways.note({0: (0.1, 0.0)})
    assert ways.is_between_walls((0.15, 0.1))
    assert not ways.is_between_walls((0.6, 0.0))


def test_a_place_without_a_way_is_infinitely_far() -> None:
    """The oldest ways are forgotten: a robot that has not moved since is not joined any more."""
    ways, turn = Ways(), 0.0
    ways.note({0: (0.0, 0.0), 1: (-0.5, 0.0)})
    for step in range(1, 2500):
        turn = 0.5 * step
        ways.note({0: (turn, 0.0), 1: (-0.5, 0.0)})
    assert math.isinf(ways.row(0)[1]) or ways.row(0)[1] >= turn - 1.0
