"""The costmaps of one robot: the local one that moves with it, and the outline that parameters give."""

import numpy as np
import pytest

from zteam.geometry import Pose2
from zteam.messages.base import DEFAULT_BASE
from zteam.navigation.planning.costmap import FREE_SPACE, LETHAL_OBSTACLE
from zteam.navigation.planning.grid import make_map
from zteam.navigation.planning.parameters import Parameters, WindowOptions
from zteam.navigation.planning.scans import Scan, Teammate
from zteam.navigation.process.costmaps import Costmaps, Situation

HERE = Pose2(0.0, 0.0, 0.0)


def ahead(distance: float) -> Scan:
    """One beam ahead that meets something."""
    return Scan(np.full(1, distance, np.float32), 0.0, 0.1, 0.0, 30.0, HERE)


def costmaps() -> Costmaps:
    """On an empty map of 20 m around the origin."""
    grid = make_map(np.zeros((200, 200), np.int8), 0.1, Pose2(-10.0, -10.0, 0.0))
    return Costmaps(Parameters(), DEFAULT_BASE, grid)


def test_what_was_seen_keeps_its_place_while_the_robot_drives() -> None:
    """The local costmap is 3 m wide and has the robot in its middle."""
    maps = costmaps()
    maps.look_near(Situation(0.0, 0.1, HERE, HERE, ahead(1.2), ()))
    assert maps.local.cost_at(1.21, 0.02) == LETHAL_OBSTACLE
    for x in (0.31, 0.62, 0.93):
        maps.look_near(Situation(0.0, 0.1, Pose2(x, 0.0, 0.0), HERE, None, ()))
        assert maps.local.cost_at(1.21, 0.02) == LETHAL_OBSTACLE
        middle = maps.local.frame.centre_of(30, 30)
        assert middle == pytest.approx((x, 0.0), abs=0.06)
    maps.look_near(Situation(0.0, 0.1, Pose2(5.0, 0.0, 0.0), HERE, None, ()))
    maps.look_near(Situation(0.0, 0.1, HERE, HERE, None, ()))
    assert maps.local.cost_at(1.21, 0.02) == FREE_SPACE


def test_a_correction_of_the_localiser_moves_what_was_seen_with_the_robot() -> None:
    """What lasers saw is known in `odom`: it stays where it is beside the robot."""
    maps = costmaps()
    maps.look_near(Situation(0.0, 0.1, HERE, HERE, ahead(1.2), ()))
    corrected = Pose2(2.0, 3.0, 0.5)
    maps.look_near(Situation(0.0, 0.1, corrected, corrected, None, ()))
    place = corrected.compose(Pose2(1.21, 0.02, 0.0))
    assert maps.local.cost_at(place.x, place.y) == LETHAL_OBSTACLE


def test_teammates_are_obstacles_where_they_are_now() -> None:
    """In both, and no longer where they were; what a laser meets on one is no obstacle of its own."""
    maps = costmaps()
    maps.look(Situation(1.0, 0.1, HERE, HERE, ahead(0.9), [Teammate(1.2, 0.0, 0.3)]))
    assert maps.local.cost_at(1.2, 0.0) == maps.whole.cost_at(1.2, 0.0) == LETHAL_OBSTACLE
    maps.look(Situation(3.0, 0.1, HERE, HERE, None, [Teammate(-1.0, 0.0, 0.3)]))
    assert maps.local.cost_at(1.2, 0.0) == maps.whole.cost_at(1.2, 0.0) == FREE_SPACE
    assert maps.of_map().cost_at(-1.0, 0.0) == FREE_SPACE


def test_costmaps_are_updated_at_their_frequencies() -> None:
    """The local one five times a second, the global one once."""
    maps = costmaps()
    maps.look(Situation(0.0, 0.1, HERE, HERE, None, ()))
    maps.look(Situation(0.1, 0.1, HERE, HERE, ahead(1.2), ()))
    assert maps.local.cost_at(1.21, 0.02) == FREE_SPACE
    maps.look(Situation(0.2, 0.1, HERE, HERE, ahead(1.2), ()))
    assert (maps.local.cost_at(1.21, 0.02), maps.whole.cost_at(1.21, 0.02)) == (LETHAL_OBSTACLE, FREE_SPACE)
    maps.look(Situation(1.0, 0.1, HERE, HERE, ahead(1.2), ()))
    assert maps.whole.cost_at(1.21, 0.02) == LETHAL_OBSTACLE


def test_the_outline_is_that_of_the_parameters_or_of_the_base() -> None:
    """A text of corners, in all spellings of numbers that Nav2 reads, a padded radius, or nothing."""
    triangle = WindowOptions(footprint="[[0.2, 0.2], [0.2, -0.2], [-0.2, 0.0]]", footprint_padding=0.0).outline(
        DEFAULT_BASE
    )
    assert triangle.corners.tolist() == [[0.2, 0.2], [0.2, -0.2], [-0.2, 0.0]]
    for text in ("", "[]", "[ ]"):
        assert WindowOptions(robot_radius=0.5, footprint=text).outline(DEFAULT_BASE).inscribed_radius == 0.53
    loose = "[[.21, 1.], [+0.2, -5e-2], [-2E-1,-.3]]"
    assert WindowOptions(footprint=loose, footprint_padding=0.0).outline(DEFAULT_BASE).corners.tolist() == [
        [0.21, 1.0], [0.2, -0.05], [-0.2, -0.3],
    ]  # fmt: skip
    assert WindowOptions(footprint_padding=0.0).outline(DEFAULT_BASE).corners.tolist() == [
        list(corner) for corner in DEFAULT_BASE.footprint
    ]
    for text in ("[[0, 0]]", "round", "[[0, 0], [1, 1], [2, 2]]", "[[1e400, 0], [1, 1], [0, 1]]", "[{}]", "[" * 5000):
        with pytest.raises(ValueError, match="corners"):
            WindowOptions(footprint=text).outline(DEFAULT_BASE)
