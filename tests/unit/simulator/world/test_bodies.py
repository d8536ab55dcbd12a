"""Bodies of models: outlines, how they are fitted, and what makes them."""

import math
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest
from PIL import Image

from support.world_texts import LoadText, box_of
from zteam.geometry import Pose2, signed_area
from zteam.messages import Twist, Vector3
from zteam.sim import Engine, Options
from zteam.simulator.world import bodies
from zteam.simulator.world.bodies import (
    Block,
    boundary_slabs,
    fit_blocks,
    place_blocks,
)
from zteam.simulator.world.properties import Size3


def test_blocks_of_a_model_are_fitted_together() -> None:
    """Two blocks keep their places to each other; heights are measured from 0, not from the lowest block."""
    left = Block(((0, 0), (1, 0), (1, 2), (0, 2)), 1, 2)
    right = Block(((3, 0), (4, 0), (4, 1), (3, 1)), 2, 4)
    fitted = fit_blocks([left, right], Size3(8, 2, 1))
    assert fitted[0].points == ((-4, -1), (-2, -1), (-2, 1), (-4, 1))
    assert fitted[1].points == ((2, -1), (4, -1), (4, 0), (2, 0))
    assert [(block.z_min, block.z_max) for block in fitted] == [(0.25, 0.5), (0.5, 1)]


def test_placed_shapes_are_rotated_moved_raised_and_counter_clockwise() -> None:
    """A clockwise outline is turned round, and its pose and height applied."""
    block = Block(((-1, -1), (-1, 1), (2, 1), (2, -1)), 0, 1)
    (shape,) = place_blocks([block], Pose2(10, 20, math.pi / 2), 0.5, (0.25, False, "blue"))
    assert signed_area(shape.points) == pytest.approx(6)
    assert sorted(shape.points) == [pytest.approx(p) for p in [(9, 19), (9, 22), (11, 19), (11, 22)]]
    assert (shape.z_min, shape.z_max, shape.ranger_return, shape.obstacle) == (0.5, 1.5, 0.25, False)


def test_a_boundary_is_four_thin_slabs_inside_the_box() -> None:
    """The slabs reach the box's faces, are 1 cm thick and as high as the box."""
    slabs = boundary_slabs(Size3(10, 4, 2))
    boxes = [(*map(min, zip(*slab.points, strict=True)), *map(max, zip(*slab.points, strict=True))) for slab in slabs]
    assert boxes == [(-5, -2, 5, -1.99), (-5, 1.99, 5, 2), (-5, -2, -4.99, 2), (4.99, -2, 5, 2)]
    assert all((slab.z_min, slab.z_max) == (0, 2) for slab in slabs)


@pytest.fixture
def bitmap(tmp_path: Path) -> str:
    """Name of a 10 × 8 bitmap: pixels x 2..5, y 1..6 from below are black, but one in the middle."""
    pixels = np.full((8, 10), 255, np.uint8)
    pixels[1:7, 2:6] = 0
    pixels[3, 3] = 205
    Image.fromarray(pixels).save(tmp_path / "b.png")
    return "b.png"


def test_a_model_is_a_box_of_its_size(load: LoadText) -> None:
    """A model without blocks is an upright box centred on its pose, 10 cm wide by default."""
    world = load("model ( size [1 2 3] pose [4 5 6 90] )\nmodel ()")
    big, small = world.obstacles
    assert big.pose == pytest.approx((4, 5, math.pi / 2))
    assert box_of(big.shapes[0]) == (-0.5, -1, 0.5, 1)
    assert (big.shapes[0].z_min, big.shapes[0].z_max) == (6, 9)
    assert box_of(small.shapes[0]) == pytest.approx((-0.05, -0.05, 0.05, 0.05))
    assert small.shapes[0].z_max == 0.1


def test_origin_moves_and_turns_the_body(load: LoadText) -> None:
    """`origin` is the body's pose in the model's frame, height included."""
    (obstacle,) = load("model ( size [1 2 3] origin [10 0 0.5 90] )").obstacles
    assert box_of(obstacle.shapes[0]) == pytest.approx((9, -0.5, 11, 0.5))
    assert (obstacle.shapes[0].z_min, obstacle.shapes[0].z_max) == (0.5, 3.5)


def test_children_stand_on_their_parent(load: LoadText) -> None:
    """A child's pose is in its parent's frame and its foot on the parent's top, unless children are not stacked."""
    text = "model ( size [1 1 2] pose [1 0 0 90] origin [5 5 5 0] {} model ( size [1 1 1] pose [2 0 0.5 0] ) )"
    for extra, foot in (("", 2.5), ("stack_children 0", 0.5)):
        parent, child = load(text.format(extra)).obstacles
        assert child.pose == pytest.approx((1, 2, math.pi / 2))
        assert child.shapes[0].z_min == pytest.approx(foot)
        assert (parent.name, child.name) == ("model:0", "model:0.model:0")


def test_surfaces(load: LoadText) -> None:
    """`ranger_return` and `obstacle_return` reach the shapes; `laser_return` is an old name of the first."""
    plain, odd, old, both = load(
        "model()\nmodel ( ranger_return -1 obstacle_return 0 )\nmodel ( laser_return 2 )\n"
        "model ( laser_return 2 ranger_return 0.5 )"
    ).obstacles
    assert [(o.shapes[0].ranger_return, o.shapes[0].obstacle) for o in (plain, odd, old, both)] == [
        (1, True),
        (-1, False),
        (2, True),
        (0.5, True),
    ]


def test_blocks_replace_the_box(load: LoadText) -> None:
    """A model with blocks has just these, fitted to its size; z is 0 to 1 by default, and repeated corners are one."""
    triangle = "block ( points 5 point[0] [0 0] point[1] [2 0] point[2] [2 0] point[3] [0 2] point[4] [0 0] )"
    (obstacle,) = load(f"model ( size [4 4 1] {triangle} )").obstacles
    assert sorted(obstacle.shapes[0].points) == [(-2, -2), (-2, 2), (2, -2)]
    assert (obstacle.shapes[0].z_min, obstacle.shapes[0].z_max) == (0, 1)


def test_odd_blocks_are_mended_with_a_remark(load: LoadText) -> None:
    """A crossing outline becomes its hull, one without an area is left out, and both are said."""
    cross = "block ( points 4 point[0] [0 0] point[1] [2 2] point[2] [2 0] point[3] [0 2] )"
    line = "block ( points 3 point[0] [0 0] point[1] [1 1] point[2] [2 2] )"
    world = load(f"model ( size [2 2 1] {cross} {line} )")
    assert [len(shape.points) for shape in world.obstacles[0].shapes] == [4]
    assert box_of(world.obstacles[0].shapes[0]) == (-1, -1, 1, 1)
    assert [remark.text.split(":")[0] for remark in world.warnings] == [
        "this block's outline crosses itself",
        "a block without an area is ignored",
    ]


def test_noblocks_and_boundary(load: LoadText) -> None:
    """`noblocks` takes the box away that a model has without a word, and it alone; `boundary` puts slabs round it."""
    block = "block ( points 3 point[0] [0 0] point[1] [2 0] point[2] [0 2] )"
    text = f"model ( noblocks 1 )\nmodel ( noblocks 1 boundary 1 size [4 2 1] )\nmodel ( noblocks 1 {block} )"
    assert [len(obstacle.shapes) for obstacle in load(text).obstacles] == [4, 1]


def test_a_flat_map_is_loaded_and_seen_by_no_laser(load: LoadText, bitmap: str) -> None:
    """`size [16 16 0]` is a picture on the ground: lasers pass over it, robots drive over it, and a remark says so."""
    laser = "ranger ( sensor ( range [0 5] samples 3 fov 90 ) )"
    world = load(f'model ( bitmap "{bitmap}" size [16 16 0] )', f"\nposition ( {laser} )")
    (floor,) = world.floorplans
    assert (floor.z_min, floor.z_max) == (0, 0)
    assert [str(remark).partition("w.world:")[2] for remark in world.warnings] == [
        "1:24: this body is flat: lasers pass over it and robots drive over it, as in Stage"
    ]
    for physics in ("dynamic", "stage", "kinematic"):
        engine = Engine(world, options=Options(physics=physics))  # type: ignore[arg-type]
        assert engine.observe().robots[0].readings[0].ranges.tolist() == [5, 5, 5]
        for _ in range(20):
            engine.move({0: Twist(Vector3(1.0))})
        assert engine.truth(0) == pytest.approx((2, 0, 0))


@pytest.mark.parametrize("size", ["[0 1 1]", "[1 0 1]", "[0 0 0]"])
def test_a_body_without_an_area_is_none(load: LoadText, bitmap: str, size: str) -> None:
    """A line is nothing that could be met, of a box, a map and a robot; each is said."""
    world = load(f'model ( size {size} )\nmodel ( bitmap "{bitmap}" size {size} )', f"\nposition ( size {size} )")
    assert (world.floorplans, world.obstacles, world.robots[0].shapes) == ((), (), ())
    assert world.robots[0].wheel_separation > 0
    assert [remark.text.split(" m ")[1] for remark in world.warnings] == ["is no obstacle, and no laser sees it"] * 3
    Engine(world).step({0: Twist(Vector3(1.0))})


def test_points_that_a_block_lacks_are_at_its_origin(load: LoadText) -> None:
    """Stage takes [0 0] for a point that is not given; a block of fewer than three points has no area."""
    world = load(
        "model ( size [2 2 1] block ( points 3 point[1] [1 0] point[2] [0 1] ) )\nmodel ( block ( points 2 ) )"
    )
    assert world.obstacles[0].shapes[0].points == ((-1, -1), (1, -1), (-1, 1))
    assert [remark.text for remark in world.warnings] == [
        "a block of 3 points lacks point[0]: [0 0] is taken, as Stage does",
        *(f"a block of 2 points lacks point[{i}]: [0 0] is taken, as Stage does" for i in (0, 1)),
        "a block without an area is ignored",
    ]


def test_blocks_without_a_height_are_flat(load: LoadText) -> None:
    """`z [0 0]` is a mark on the ground, as Stage has it."""
    corners = "points 3 point[0] [0 0] point[1] [1 0] point[2] [0 1]"
    world = load(f"model ( size [1 1 1] block ( {corners} z [0 0] ) )")
    assert [(shape.z_min, shape.z_max) for shape in world.obstacles[0].shapes] == [(0, 0)]
    assert [remark.text[:17] for remark in world.warnings] == ["this body is flat"]


def test_a_bitmap_is_cropped_and_stretched_like_stage(load: LoadText, bitmap: str) -> None:
    """By default the box of black pixels fills the model's size, whatever margin the image has."""
    (floor,) = load(f'model ( name "m" bitmap "{bitmap}" size [8 3 2] pose [10 20 1 0] )').floorplans
    assert floor.name == "m"
    assert floor.occupied.shape == (6, 4)
    assert not floor.occupied[3, 1]
    assert floor.occupied.sum() == 23
    assert floor.cell == (2, 0.5)
    assert floor.pose == (6, 18.5, 0)
    assert (floor.z_min, floor.z_max) == (1, 3)


def test_a_bitmap_can_be_read_as_a_whole(load: LoadText, bitmap: str) -> None:
    """Asked by the caller or by the model the whole image fills the size; the model has the last word."""
    text = f'model ( bitmap "{bitmap}" size [10 8 1] {{}} )'
    for extra, option, shape in (
        ("", False, (6, 4)),
        ("", True, (8, 10)),
        ('bitmap_reading "whole"', False, (8, 10)),
        ('bitmap_reading "crop"', True, (6, 4)),
    ):
        (floor,) = load(text.format(extra), whole_bitmaps=option).floorplans
        assert floor.occupied.shape == shape


def test_a_floor_may_have_a_boundary(load: LoadText, bitmap: str) -> None:
    """The slabs of `boundary 1` are an obstacle of their own, as high as the floor, with its surface."""
    world = load(f'model ( name "m" bitmap "{bitmap}" size [4 2 1] boundary 1 ranger_return 0.5 obstacle_return 0 )')
    (slabs,) = world.obstacles
    assert slabs.name == "m.boundary"
    assert [(s.z_max, s.ranger_return, s.obstacle) for s in slabs.shapes] == [(1, 0.5, False)] * 4
    assert (world.floorplans[0].ranger_return, world.floorplans[0].obstacle) == (0.5, False)


def test_a_bitmap_on_a_robot_becomes_rectangles(load: LoadText, bitmap: str) -> None:
    """A robot's body cannot be a floor: its black cells are covered by boxes of the right total area."""
    (robot,) = load(f'position ( bitmap "{bitmap}" size [4 6 1] )', "").robots
    boxes = [box_of(shape) for shape in robot.shapes]
    assert sum((right - left) * (top - bottom) for left, bottom, right, top in boxes) == pytest.approx(23)


def test_a_fine_bitmap_on_a_robot_is_taken_as_its_box(load: LoadText, tmp_path: Path) -> None:
    """Hundreds of specks are too much for a body that moves; the remark says what is done."""
    Image.fromarray((np.indices((40, 40)).sum(axis=0) % 2 * 255).astype(np.uint8)).save(tmp_path / "c.png")
    world = load('position ( bitmap "c.png" size [1 1 1] )', "")
    assert [box_of(shape) for shape in world.robots[0].shapes] == [(-0.5, -0.5, 0.5, 0.5)]
    assert "its box is taken" in world.warnings[0].text


@pytest.mark.parametrize("distance", [2, 41])
def test_robots_of_one_bitmap_share_its_rectangles(
    load: LoadText, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, distance: int
) -> None:
    """They are looked for once, also where they are too many: a small file makes no long work."""
    find = Mock(wraps=bodies.rectangles)
    monkeypatch.setattr(bodies, "rectangles", find)
    pixels = np.where(np.indices((40, 40)).sum(axis=0) % distance, 255, 0)
    Image.fromarray(pixels.astype(np.uint8)).save(tmp_path / "c.png")
    robots = load('position ( bitmap "c.png" )\n' * 3, "").robots
    assert [len(robot.shapes) for robot in robots] == [1 if distance == 2 else 39] * 3
    find.assert_called_once()


def test_a_device_without_a_simulation_keeps_its_body(load: LoadText) -> None:
    """A gripper is a box on its robot; a camera or a fiducial finder has no body."""
    world = load("position ( gripper ( size [0.1 0.1 0.1] ) camera () fiducial () )", "")
    assert len(world.robots[0].shapes) == 2


def test_a_bitmap_without_a_black_pixel(load: LoadText, tmp_path: Path) -> None:
    """There is no box to crop to, and so no body, as in Stage; as a whole image it is an empty floor."""
    Image.fromarray(np.full((4, 4), 255, np.uint8)).save(tmp_path / "white.png")
    world = load('model ( bitmap "white.png" )\nmodel ( bitmap "white.png" boundary 1 )')
    assert (world.floorplans, len(world.obstacles)) == ((), 1)
    assert ["has no occupied pixel" in remark.text for remark in world.warnings] == [True, True]
    world = load('model ( bitmap "" )')
    assert (world.floorplans, world.obstacles) == ((), ())
    assert [str(remark).partition("w.world:")[2] for remark in world.warnings] == ["1:9: no bitmap is named: no body"]
    assert not load('model ( bitmap "white.png" )', whole_bitmaps=True).floorplans[0].occupied.any()
