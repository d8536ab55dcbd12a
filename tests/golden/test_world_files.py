"""zteam's own world files: a small one for each feature of the language, and the shipped ones."""

import math
import runpy

import numpy as np
import pytest
from PIL import Image

from support.recordings import WORLDS
from support.small_worlds import is_occupied
from zteam.config.resources import worlds_folder
from zteam.errors import WorldError
from zteam.geometry import Pose2
from zteam.simulator.world.placing import find_misplaced
from zteam.world import World, add_robot, load_world


def load(name: str) -> World:
    return load_world(WORLDS / f"{name}.world")


@pytest.mark.parametrize(
    ("name", "robots", "rangers", "obstacles", "cells", "remarks"),
    [
        ("crop", 2, 1, 0, [(12, 20)], 0),
        ("whole", 1, 1, 0, [(16, 23)], 0),
        ("turned", 1, 1, 1, [(12, 20)], 0),
        ("flat", 1, 1, 0, [(12, 20)], 1),
        ("stacked", 2, 5, 1, [], 0),
        ("devices", 2, 0, 2, [], 8),
        ("drives", 3, 0, 0, [], 0),
        ("units", 1, 1, 1, [], 0),
        ("old", 1, 1, 1, [], 2),
        ("crowd", 32, 1, 3, [], 0),
        ("numbers", 2, 0, 0, [], 6),
        ("floor", 0, 0, 0, [(12, 20)], 0),
    ],
)
def test_worlds_load_as_they_are(
    name: str, robots: int, rangers: int, obstacles: int, cells: list[tuple[int, int]], remarks: int
) -> None:
    """Robots, the first robot's sensors, obstacles, bitmaps and remarks are those of the file."""
    world = load(name)
    assert (len(world.robots), len(world.obstacles), len(world.warnings)) == (robots, obstacles, remarks)
    assert len(world.robots[0].rangers if world.robots else ()) == rangers
    assert [floor.occupied.shape for floor in world.floorplans] == cells


def test_a_type_that_stage_does_not_know_is_an_error_with_its_place() -> None:
    """The error names the line of the unknown type, not the end of the file."""
    with pytest.raises(WorldError, match=r"unknown\.world:3:1: unknown model type 'map'"):
        load("unknown")


def test_a_turned_map_keeps_its_cells() -> None:
    """A map is rotated by its pose only; its origin rotates with it, and the robot starts on free cells."""
    world = load("turned")
    (floor,) = world.floorplans
    assert floor.pose == pytest.approx((4, -2.5, math.pi / 2))
    assert not is_occupied(floor, world.robots[0].pose.x, world.robots[0].pose.y)
    assert is_occupied(floor, 3.9, 0.0) and not is_occupied(floor, 4.1, 0.0)


def test_heights_of_what_is_stacked() -> None:
    """Bodies are stacked; sonars are at half of their body's height, and a scanner is above its body."""
    carrier = load("stacked").robots[0]
    assert [ranger.z for ranger in carrier.rangers] == pytest.approx([0.13] * 4 + [0.35])
    heights = [(shape.z_min, shape.z_max) for shape in carrier.shapes]
    assert heights == [pytest.approx((0, 0.22)), pytest.approx((0.24, 0.44))]


def test_macros_of_an_included_file_make_further_robots() -> None:
    """A robot macro that its file does not use can make a robot, with macros that are defined after it."""
    robot = add_robot(load("crop"), "cart", Pose2(1, 2, 0), "robot_5")
    assert (robot.localization, len(robot.rangers), robot.rangers[0].x) == ("odom", 1, 0.1)
    with pytest.raises(WorldError, match=r"no robot macro 'house' .* there are: base, cart, erratic"):
        add_robot(load("crop"), "house", Pose2(0, 0, 0), "robot_6")


@pytest.mark.parametrize(("name", "robots"), [("office", 4), ("arena", 2)])
def test_shipped_worlds_load_without_remarks(name: str, robots: int) -> None:
    """They use only what zteam supports; lasers are low enough to see other robots, and each robot has room."""
    world = load_world(worlds_folder() / f"{name}.world")
    assert (world.name, len(world.robots), world.warnings) == (name, robots, ())
    for robot in world.robots:
        assert [ranger.samples for ranger in robot.rangers] == [1081]
        assert robot.rangers[0].z < robot.shapes[0].z_max
    assert list(find_misplaced(world)) == []


def test_the_offices_picture_is_what_its_script_draws() -> None:
    """office.png is not edited by hand: the script beside it draws the same pixels."""
    drawn = runpy.run_path(str(worlds_folder() / "office.py"))["draw"]()
    with Image.open(worlds_folder() / "office.png") as picture:
        assert np.array_equal(np.asarray(picture.convert("RGB")), np.asarray(drawn))
