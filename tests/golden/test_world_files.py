"""zteam's own world files: a small one for each feature of the language, and the shipped ones."""

import math
import runpy
from collections import deque
from typing import Any

import numpy as np
import pytest
from PIL import Image

from support.recordings import WORLDS
from support.small_worlds import is_occupied
from zteam.config.resources import worlds_folder
from zteam.errors import WorldError
from zteam.geometry import Pose2
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


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("devices", "devices.world:6:3: ctrl is ignored"),
        ("devices", "devices.world:12:3: cameras are not simulated"),
        ("devices", "devices.world:13:3: grippers are not simulated"),
        ("old", "old.world:3:1: unknown property 'interval_real' is ignored"),
        ("flat", "flat.world:4:9: this body is flat"),
        ("numbers", "numbers.world:2:25: '3.75.2' is not a number: 3.75 is taken"),
    ],
)
def test_what_is_not_simulated_is_remarked(name: str, text: str) -> None:
    """Remarks name devices and controllers that zteam lacks, and odd values, with file, line and column."""
    assert any(text in str(remark) for remark in load(name).warnings)


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
    """Shipped worlds use only what zteam supports; lasers are low enough to see the other robots."""
    world = load_world(worlds_folder() / f"{name}.world")
    assert (world.name, len(world.robots), world.warnings) == (name, robots, ())
    for robot in world.robots:
        assert [ranger.samples for ranger in robot.rangers] == [1081]
        assert robot.rangers[0].z < robot.shapes[0].z_max


def test_no_robot_of_the_office_starts_in_a_wall() -> None:
    """The floor is free 0.5 m around every start pose, and 15 m straight ahead of the leader."""
    world = load_world(worlds_folder() / "office.world")
    (floor,) = world.floorplans
    assert floor.pose == (0, 0, 0)
    assert floor.cell == pytest.approx((0.05, 0.05))
    steps = np.arange(-0.5, 0.51, 0.05)
    for robot in world.robots:
        assert not any(is_occupied(floor, robot.pose.x + dx, robot.pose.y + dy) for dx in steps for dy in steps)
    leader = world.robots[0].pose
    assert leader.yaw == 0
    assert not any(is_occupied(floor, leader.x + d, leader.y + dy) for d in np.arange(0, 15, 0.05) for dy in steps)
    offsets = [(robot.pose.x - leader.x, robot.pose.y - leader.y) for robot in world.robots]
    assert offsets == [(0, 0), (-2.25, 0), (0, -2), (-2.25, -2)]


def test_no_robot_of_the_arena_starts_in_an_obstacle() -> None:
    """Every obstacle is farther from every start pose than a robot is wide, and the walls close the arena."""
    world = load_world(worlds_folder() / "arena.world")
    corners = [
        obstacle.pose.compose(Pose2(x, y, 0))[:2]
        for obstacle in world.obstacles
        for shape in obstacle.shapes
        for x, y in shape.points
    ]
    assert (np.max(corners, axis=0), np.min(corners, axis=0)) == (pytest.approx([5, 5]), pytest.approx([-5, -5]))
    for robot in world.robots:
        assert min(math.dist(corner, robot.pose[:2]) for corner in corners) > 1


def test_the_offices_picture_is_what_its_script_draws() -> None:
    """office.png is not edited by hand: the script beside it draws the same pixels."""
    drawn = runpy.run_path(str(worlds_folder() / "office.py"))["draw"]()
    with Image.open(worlds_folder() / "office.png") as picture:
        assert np.array_equal(np.asarray(picture.convert("RGB")), np.asarray(drawn))


def reachable(free: np.ndarray[Any, np.dtype[np.bool_]], start: tuple[int, int]) -> np.ndarray[Any, np.dtype[np.bool_]]:
    """The free cells that are connected with `start`."""
    reached = np.zeros_like(free)
    reached[start] = free[start]
    queue = deque([start])
    while queue:
        row, column = queue.popleft()
        for near in ((row + 1, column), (row - 1, column), (row, column + 1), (row, column - 1)):
            if free[near] and not reached[near]:
                reached[near] = True
                queue.append(near)
    return reached


@pytest.mark.ci
def test_a_robot_can_drive_into_every_room_of_the_office() -> None:
    """Every room can be reached from the start 0.4 m away from all obstacles (doors are 1.1 m wide)."""
    world = load_world(worlds_folder() / "office.world")
    occupied = world.floorplans[0].occupied
    near = occupied.copy()
    for radius in range(1, 9):  # cells of 5 cm
        width = math.isqrt(64 - radius * radius)
        for shift in (radius, -radius):
            moved = np.roll(occupied, shift, axis=0)
            near |= moved
            for across in range(1, width + 1):
                near |= np.roll(moved, across, axis=1) | np.roll(moved, -across, axis=1)
    for across in range(1, 9):
        near |= np.roll(occupied, across, axis=1) | np.roll(occupied, -across, axis=1)
    start = world.robots[0].pose
    reached = reachable(~near, (round(start.y / 0.05), round(start.x / 0.05)))
    side = [(6.0, y) for y in (1.5, 8.5, 14.5, 32.5, 38.5, 44.5)]
    rooms = [
        *side,
        *((50 - x, y) for x, y in side),
        *((x, 44.2) for x in (10.7, 16.9, 23.1, 29.3, 35.5)),
        *((16.8, 6.0), (25.0, 4.0), (33.2, 5.6), (16.3, 14.2), (18.6, 34.9), (32.0, 28.5)),
        *((27.6, 10.8), (27.6, 17.4), (39.4, 10.8), (39.4, 17.4), (30.3, 39.4), (34.5, 39.4), (39.3, 39.4)),
        *((4.0, 25.0), (46.0, 25.0)),
    ]
    unreached = [(x, y) for x, y in rooms if not reached[round(y / 0.05), round(x / 0.05)]]
    assert unreached == []
