"""The worlds of Stage and stage_ros give what was recorded from Stage."""

import pytest

from support.recordings import SHARED
from zteam.errors import WorldError
from zteam.geometry import Pose2
from zteam.simulator.world.bodies import occupied_box, read_bitmap
from zteam.world import add_robot, load_world

if not SHARED.is_dir():
    pytest.skip(f"the worlds of Stage and the full recordings are not here ({SHARED})", allow_module_level=True)

WORLDS = SHARED / "worlds"


@pytest.mark.few(4)
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
    """Each world that Stage loads is loaded, with its robots, the first robot's sensors and the cropped bitmap."""
    world = load_world(WORLDS / f"{name}.world")
    assert len(world.robots) == robots
    assert len(world.robots[0].rangers) == rangers
    assert [floor.occupied.shape for floor in world.floorplans] == [cells]


@pytest.mark.parametrize(
    "name", ["stage_ros/willow-lesson3", "stage_ros/willow-erratic", "stage_ros/willow-four-erratics"]
)
def test_a_world_that_asks_for_nothing_else_has_no_remarks(name: str) -> None:
    """The lectures' worlds are loaded without remarks."""
    assert load_world(WORLDS / f"{name}.world").warnings == ()


def test_worlds_that_cannot_run_are_clear_errors() -> None:
    """The error names a type that Stage does not know either; a file with macros only has no robot."""
    with pytest.raises(WorldError, match=r"wifi\.world:26:1: unknown model type 'map'"):
        load_world(WORLDS / "stage" / "wifi.world")
    assert load_world(WORLDS / "stage_ros" / "erratic-inc.world").robots == ()


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
    """The bitmap is cropped to the box that was measured in Stage."""
    grid = read_bitmap(WORLDS / bitmap)
    assert grid.shape == shape
    height = shape[0]
    assert occupied_box(grid) == (height - rows_from_top[1], height - rows_from_top[0], *columns)


def test_willow_is_stretched_or_honest() -> None:
    """Cropped as in Stage the map is 1.5 % and 2.8 % too large; uncropped, its cells equal the lectures' map."""
    path = WORLDS / "stage_ros" / "willow-lesson3.world"
    (stage,), (whole,) = load_world(path).floorplans, load_world(path, whole_bitmaps=True).floorplans
    assert stage.pose == whole.pose == (-27, -29.35, 0)
    assert whole.cell == pytest.approx((0.1, 0.1))
    assert (stage.cell[0] / whole.cell[0], stage.cell[1] / whole.cell[1]) == pytest.approx((1.015, 1.028), abs=5e-4)
    assert whole.occupied.sum() == stage.occupied.sum()


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


def test_the_files_own_macros_make_further_robots() -> None:
    """A robot macro of an included file can be used for a robot that the world lacks."""
    world = load_world(WORLDS / "stage" / "simple.world")
    robot = add_robot(world, "fancypioneer2dx", Pose2(1, 2, 0), "robot_5")
    assert len(robot.rangers) == 16
    assert len(robot.shapes) == 7
    with pytest.raises(WorldError, match=r"pioneer\.inc:\d+:3: size takes 3 numbers, not 2"):
        add_robot(world, "pioneer3at", Pose2(0, 0, 0), "robot_6")
