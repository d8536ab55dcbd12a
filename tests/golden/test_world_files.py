"""The worlds that Stage and stage_ros ship, judged by what Stage made of them, and the worlds that zteam ships."""

import gzip
import json
import math
import runpy
from collections import deque
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from zteam.errors import WorldError
from zteam.geometry import Pose2, compose2
from zteam.shipped import worlds_folder
from zteam.world import Floorplan, Ranger, Robot, add_robot, load_world
from zteam.world.bitmap import occupied_box, read_bitmap

SHARED = Path(__file__).resolve().parents[2].parent / "shared"
WORLDS, GOLDEN = SHARED / "worlds", SHARED / "golden"
needs_worlds = pytest.mark.skipif(not WORLDS.is_dir(), reason=f"no test worlds at {WORLDS}")
needs_golden = pytest.mark.skipif(not GOLDEN.is_dir(), reason=f"no recordings at {GOLDEN}")


@needs_worlds
@pytest.mark.parametrize(
    ("name", "robots", "rangers", "cells"),
    [
        ("stage_ros/willow-lesson3", 4, 1, (571, 532)),
        ("stage_ros/willow-erratic", 1, 1, (571, 532)),
        ("stage_ros/willow-four-erratics", 4, 1, (571, 532)),
        ("stage_ros/willow-four-erratics-multisensor", 4, 2, (571, 532)),
        ("stage/simple", 2, 17, (500, 500)),
        ("stage/circuit", 94, 8, (609, 1196)),
        ("stage/fasr", 20, 17, (500, 500)),
        ("stage/pioneer_flocking", 100, 8, (500, 500)),
        ("stage/pioneer_follow", 1, 17, (500, 500)),
        ("stage/pioneer_walle", 2, 17, (500, 500)),
        ("stage/roomba", 1, 0, (500, 500)),
        ("stage/sensor_noise_demo", 1, 17, (500, 500)),
        ("stage/camera", 1, 17, (500, 500)),
        ("stage/everything", 14, 17, (443, 1082)),
        ("stage/benchmark/cave", 100, 17, (500, 500)),
    ],
)
def test_worlds_load_as_they_are(name: str, robots: int, rangers: int, cells: tuple[int, int]) -> None:
    """Every world that Stage loads is loaded, with its robots, the sensors of the first, and the cropped bitmap."""
    world = load_world(WORLDS / f"{name}.world")
    assert len(world.robots) == robots
    assert len(world.robots[0].rangers) == rangers
    assert [floor.occupied.shape for floor in world.floorplans] == [cells]


@needs_worlds
@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("camera", "camera.world:53:3: cameras are not simulated"),
        ("everything", "everything.world:86:3: cameras are not simulated"),
        ("everything", "everything.world:72:3: grippers are not simulated"),
        ("simple", "simple.world:53:3: ctrl is ignored"),
        ("pioneer_walle", "walle.inc:16:3: unknown property 'blobfinder_return' is ignored"),
    ],
)
def test_what_is_not_simulated_is_remarked(name: str, text: str) -> None:
    """Devices and controllers that zteam has not are said with their file, line and column."""
    assert any(text in str(remark) for remark in load_world(WORLDS / "stage" / f"{name}.world").warnings)


@needs_worlds
@pytest.mark.parametrize(
    "name", ["stage_ros/willow-lesson3", "stage_ros/willow-erratic", "stage_ros/willow-four-erratics"]
)
def test_a_world_that_asks_for_nothing_else_has_no_remarks(name: str) -> None:
    """The lectures' worlds are loaded without a word."""
    assert load_world(WORLDS / f"{name}.world").warnings == ()


@needs_worlds
def test_worlds_that_cannot_run_are_clear_errors() -> None:
    """A type that Stage does not know either is named; a file of macros has no robot."""
    with pytest.raises(WorldError, match=r"wifi\.world:26:1: unknown model type 'map'"):
        load_world(WORLDS / "stage" / "wifi.world")
    assert load_world(WORLDS / "stage_ros" / "erratic-inc.world").robots == ()


@needs_worlds
@pytest.mark.parametrize(
    ("bitmap", "shape", "columns", "rows_from_top"),
    [
        ("stage_ros/willow-full.pgm", (587, 540), (1, 533), (16, 587)),
        ("stage/bitmaps/cave.png", (500, 500), (0, 500), (0, 500)),
        ("stage/bitmaps/simple_rooms.png", (300, 400), (0, 400), (0, 300)),
    ],
)
def test_the_box_of_black_pixels_is_stages(
    bitmap: str, shape: tuple[int, int], columns: tuple[int, int], rows_from_top: tuple[int, int]
) -> None:
    """The crop is the box that was measured in Stage."""
    grid = read_bitmap(WORLDS / bitmap)
    assert grid.shape == shape
    height = shape[0]
    assert occupied_box(grid) == (height - rows_from_top[1], height - rows_from_top[0], *columns)


@needs_worlds
def test_willow_is_stretched_or_honest() -> None:
    """Read like Stage the map is 1.5 % and 2.8 % too large; read whole, its cells are those of the lectures' map."""
    path = WORLDS / "stage_ros" / "willow-lesson3.world"
    (stage,), (whole,) = load_world(path).floorplans, load_world(path, whole_bitmaps=True).floorplans
    assert stage.pose == whole.pose == (-27, -29.35, 0)
    assert whole.cell == pytest.approx((0.1, 0.1))
    assert (stage.cell[0] / whole.cell[0], stage.cell[1] / whole.cell[1]) == pytest.approx((1.015, 1.028), abs=5e-4)
    assert whole.occupied.sum() == stage.occupied.sum()


@needs_worlds
def test_a_turned_map_keeps_its_cells() -> None:
    """In stage_ros's world the map is turned by 90°: only its pose says so, and robots start on free cells."""
    world = load_world(WORLDS / "stage_ros" / "willow-erratic.world")
    (floor,) = world.floorplans
    assert floor.pose == pytest.approx((0.0, 0.0, math.pi / 2))
    assert not is_occupied(floor, world.robots[0].pose.x, world.robots[0].pose.y)


@needs_worlds
def test_heights_of_known_robots() -> None:
    """The rays of an erratic's laser leave at 0.26 m, a pioneer's sonars at 0.195 m, its SICK at 0.33 m."""
    (erratic, *_) = load_world(WORLDS / "stage_ros" / "willow-lesson3.world").robots
    assert erratic.rangers[0].z == pytest.approx(0.26)
    assert [shape.z_max for shape in erratic.shapes] == [0.25]
    (pioneer, _) = load_world(WORLDS / "stage" / "simple.world").robots
    assert [ranger.z for ranger in pioneer.rangers] == pytest.approx([0.195] * 16 + [0.33])
    assert [(shape.z_min, shape.z_max) for shape in pioneer.shapes] == [
        pytest.approx((0, 0.22)),
        pytest.approx((0.22, 0.41)),
    ]


@needs_worlds
def test_the_files_own_macros_make_further_robots() -> None:
    """A robot macro of an included file can be used for a robot that the world lacks."""
    world = load_world(WORLDS / "stage" / "simple.world")
    robot = add_robot(world, "fancypioneer2dx", Pose2(1, 2, 0), "robot_5")
    assert len(robot.rangers) == 16
    assert len(robot.shapes) == 7
    with pytest.raises(WorldError, match=r"pioneer\.inc:\d+:3: size takes 3 numbers, not 2"):
        add_robot(world, "pioneer3at", Pose2(0, 0, 0), "robot_6")


def recorded(name: str) -> Any:
    return json.loads(gzip.decompress((GOLDEN / name).read_bytes()))


def sensor_pose(robot: Robot, ranger: Ranger, pose: Pose2) -> list[float]:
    """[x, y, z, yaw] of a sensor in the map when its robot is at `pose`."""
    x, y, yaw = compose2(pose, Pose2(ranger.x, ranger.y, ranger.yaw))
    return [x, y, ranger.z, yaw]


def assert_origin(found: list[float], expected: list[float]) -> None:
    assert found[:3] == pytest.approx(expected[:3], abs=1e-8)
    assert abs(math.remainder(found[3] - expected[3], math.tau)) < 1e-8


@needs_golden
def test_sensors_of_every_recorded_scene_are_where_stage_had_them(tmp_path: Path) -> None:
    """In 16 scenes of robots, boxes and heights every ray's origin agrees with Stage's."""
    path = tmp_path / "w.world"
    checked = 0
    for scene in recorded("stage_scenes.json.gz")["scenes"]:
        path.write_text(scene["world"])
        robots = {robot.name: robot for robot in load_world(path).robots}
        for scan in scene["scans"]:
            robot = robots[scan["robot"]]
            (ranger,) = robot.rangers
            x, y, degrees = scan["pose"]
            assert_origin(sensor_pose(robot, ranger, Pose2(x, y, math.radians(degrees))), scan["origin"])
            assert (ranger.samples, math.degrees(ranger.fov)) == (scan["samples"], pytest.approx(scan["fov_deg"]))
            checked += 1
    assert checked >= 30


@needs_golden
@needs_worlds
def test_sensors_of_a_pioneer_are_where_stage_had_them() -> None:
    """16 sonars and a SICK on stacked bodies: every recorded origin, field of view and range agrees with Stage's."""
    robot = load_world(WORLDS / "stage" / "simple.world").robots[0]
    (simple,) = (world for world in recorded("stage_scans.json.gz")["worlds"] if world["name"] == "simple")
    groups = {"r0.ranger:0": robot.rangers[:16], "r0.ranger:1": robot.rangers[16:]}
    seen = set()
    for scan in simple["scans"]:
        x, y, degrees = scan["pose"]
        seen.add(scan["ranger"])
        for ranger, sensor in zip(groups[scan["ranger"]], scan["sensors"], strict=True):
            assert_origin(sensor_pose(robot, ranger, Pose2(x, y, math.radians(degrees))), sensor["origin"])
            assert (ranger.samples, math.degrees(ranger.fov)) == (sensor["samples"], pytest.approx(sensor["fov_deg"]))
            assert [ranger.range_min, ranger.range_max] == sensor["range"]
    assert seen == set(groups)


def is_occupied(floor: Floorplan, x: float, y: float) -> bool:
    """Whether a point of the map lies in an occupied cell of a floor."""
    dx, dy = x - floor.pose.x, y - floor.pose.y
    c, s = math.cos(floor.pose.yaw), math.sin(floor.pose.yaw)
    column, row = int((c * dx + s * dy) // floor.cell[0]), int((c * dy - s * dx) // floor.cell[1])
    rows, columns = floor.occupied.shape
    return 0 <= row < rows and 0 <= column < columns and bool(floor.occupied[row, column])


@pytest.mark.parametrize(("name", "robots"), [("office", 4), ("arena", 2)])
def test_shipped_worlds_load_without_remarks(name: str, robots: int) -> None:
    """What zteam ships uses nothing that zteam has not; lasers are low enough to see the other robots."""
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
        compose2(obstacle.pose, Pose2(x, y, 0))[:2]
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


def test_a_robot_can_drive_into_every_room_of_the_office() -> None:
    """With 0.4 m kept from all that is solid (doors are 1.1 m wide), every room is connected with the start."""
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
