"""How robots stand in a row where walls are between them, by the ways that they have driven."""

import math

import pytest

from support.flat_floor import LASER, Segment, cast, make_scan, make_view
from zteam.geometry import Pose2
from zteam.robot.behaviors.row import Row, is_narrow

BEND = {0: (0.0, 0.0), 1: (0.8, 0.0), 2: (1.6, 0.0), 3: (1.6, 0.9), 4: (0.8, 0.9)}
"""A team in a corridor that goes round a wall: the last one is nearer to the first than the one in the middle."""


def test_a_team_that_was_set_down_round_a_bend_is_in_a_row() -> None:
    """Down from its head they are as along the corridor, each so many metres of it from the last one."""
    row = Row()
    row.note(BEND)
    found = row.find(0)
    assert list(found) == [1, 2, 3, 4]
    assert list(found.values()) == pytest.approx([2.5, 1.7, 0.8, 0.0], abs=0.6)


def test_the_row_is_that_of_the_ways_wherever_the_robots_drive() -> None:
    """The head drives on until it is beside the last robot, with the wall between them: the row stays."""
    row = Row()
    row.note(BEND)
    for step in range(40):
        row.note({robot: (x - 0.05 * step if robot == 0 else x, y) for robot, (x, y) in BEND.items()})
    row.note({**BEND, 0: (-1.9, 0.0), 4: (0.0, 0.9)})
    assert list(row.find(0)) == [1, 2, 3, 4]


def test_a_row_whose_head_is_in_the_middle_ends_with_the_one_that_is_furthest() -> None:
    """The others are as they stand along the way."""
    row = Row()
    row.note({robot: (x, 0.0) for robot, x in ((1, 0.0), (2, 0.8), (0, 1.6), (3, 2.4), (4, 3.2), (5, 4.0))})
    assert list(row.find(0)) == [1, 2, 3, 4, 5]


def test_a_robot_that_was_set_down_elsewhere_has_left_no_way_there() -> None:
    """Its old and its new place are joined by way of the others alone."""
    row = Row()
    row.note({0: (0.0, 0.0), 1: (1.0, 0.0), 2: (2.0, 0.0)})
    row.note({0: (0.0, 0.0), 1: (0.0, 8.0), 2: (2.0, 0.0)})
    assert row.find(2)[0] == pytest.approx(8.0, abs=0.5)


def test_what_was_noted_between_walls_is_found_beside_it_too() -> None:
    """At the place and up to a cell from it, and also after other robots have come by."""
    row = Row()
    row.note({0: (0.0, 0.0)})
    row.note_walls((0.0, 0.0))
    row.note({0: (0.1, 0.0)})
    assert row.is_between_walls((0.15, 0.1))
    assert not row.is_between_walls((0.6, 0.0))


@pytest.mark.parametrize(("open_cells", "narrow"), [(4, True), (8, False)])
def test_a_corner_of_a_room_is_not_between_walls(open_cells: int, narrow: bool) -> None:
    """Most of the ground about it is open. What was narrow once stays so, whichever way the robot looks there."""
    row = Row()
    for cell in range(2):
        row.note_walls((0.2 * cell, 0.0))
        row.note_walls((0.2 * cell, 0.0), False)
    for cell in range(open_cells):
        row.note_walls((0.5 + 0.2 * (cell % 4), 0.5 + 0.2 * (cell // 4)), False)
    assert row.is_between_walls((0.1, 0.1)) is narrow


def test_the_oldest_ways_are_forgotten() -> None:
    """A robot that has not moved while another one drove a kilometre is on no way any more."""
    row = Row()
    row.note({0: (0.0, 0.0), 1: (-0.5, 0.0)})
    for step in range(1, 2500):
        row.note({0: (0.5 * step, 0.0), 1: (-0.5, 0.0)})
    assert math.isfinite(row.find(0)[1])
    row.note({0: (1250.0, 0.0), 2: (1250.0, 0.4)})
    assert list(row.find(0)) == [2]


CORRIDOR = [(-9.0, -0.5, 9.0, -0.5), (-9.0, 0.5, 9.0, 0.5)]
BEND_WALLS = [(-9.0, -0.5, 0.5, -0.5), (0.5, -0.5, 0.5, 9.0), (-9.0, 0.5, -0.5, 0.5), (-0.5, 0.5, -0.5, 9.0)]
CORNER = [(-0.45, -0.45, 9.0, -0.45), (-0.45, -0.45, -0.45, 9.0)]


@pytest.mark.parametrize(
    ("walls", "degrees", "narrow"),
    [(CORRIDOR, 0.0, True), (CORRIDOR, 45.0, True), (CORNER, 0.0, False), (CORNER, 45.0, False), (CORNER, 90.0, False)],
)
def test_a_corridor_is_narrow_and_a_corner_is_not(walls: list[Segment], degrees: float, narrow: bool) -> None:
    """Whichever way the robot looks, the nearest wall of a corridor has one across from it."""
    assert looks_narrow(walls, degrees) is narrow


def test_a_bend_is_narrow() -> None:
    """Across from its outer walls there is the edge of the inner ones."""
    assert looks_narrow(BEND_WALLS, 45.0)


def looks_narrow(walls: list[Segment], degrees: float) -> bool:
    """Whether walls are on both sides of a robot at the origin that looks in this direction."""
    pose = Pose2(0.0, 0.0, math.radians(degrees))
    return is_narrow(make_view(make_scan(cast(pose.compose(LASER), walls)), laser=LASER[:2]))
