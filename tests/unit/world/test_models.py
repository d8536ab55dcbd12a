"""zteam.world: models become floors, obstacles and robots with the poses and heights that Stage gives them."""

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from zteam.messages import Twist, Vector3
from zteam.sim import Engine, Options
from zteam.world import Limits, Robot, Shape, World, load_world

ROBOT = "position ( size [0.35 0.35 0.25] origin [-0.05 0 0 0] "

Load = Callable[..., World]


@pytest.fixture
def load(tmp_path: Path) -> Load:
    """Loads the text of a world, with a robot added at its end."""

    def load_text(text: str, robot: str = "\nposition ()", *, whole_bitmaps: bool = False) -> World:
        path = tmp_path / "w.world"
        path.write_text(text + robot)
        return load_world(path, whole_bitmaps=whole_bitmaps)

    return load_text


def box_of(shape: Shape) -> tuple[float, float, float, float]:
    xs, ys = zip(*shape.points, strict=True)
    return (min(xs), min(ys), max(xs), max(ys))


def test_the_world_has_a_name_and_an_interval(load: Load) -> None:
    """`interval_sim` is milliseconds, 100 by default; the name is the file's unless it has one."""
    assert (load("").name, load("").interval) == ("w", 100_000_000)
    world = load('name "x" interval_sim 20.5')
    assert (world.name, world.interval) == ("x", 20_500_000)


def test_a_model_is_a_box_of_its_size(load: Load) -> None:
    """A model without blocks is an upright box centred on its pose, 10 cm wide by default."""
    world = load("model ( size [1 2 3] pose [4 5 6 90] )\nmodel ()")
    big, small = world.obstacles
    assert big.pose == pytest.approx((4, 5, math.pi / 2))
    assert box_of(big.shapes[0]) == (-0.5, -1, 0.5, 1)
    assert (big.shapes[0].z_min, big.shapes[0].z_max) == (6, 9)
    assert box_of(small.shapes[0]) == pytest.approx((-0.05, -0.05, 0.05, 0.05))
    assert small.shapes[0].z_max == 0.1


def test_origin_moves_and_turns_the_body(load: Load) -> None:
    """`origin` is the body's pose in the model's frame, height included."""
    (obstacle,) = load("model ( size [1 2 3] origin [10 0 0.5 90] )").obstacles
    assert box_of(obstacle.shapes[0]) == pytest.approx((9, -0.5, 11, 0.5))
    assert (obstacle.shapes[0].z_min, obstacle.shapes[0].z_max) == (0.5, 3.5)


def test_children_stand_on_their_parent(load: Load) -> None:
    """A child's pose is in its parent's frame and its foot on the parent's top, unless children are not stacked."""
    text = "model ( size [1 1 2] pose [1 0 0 90] origin [5 5 5 0] {} model ( size [1 1 1] pose [2 0 0.5 0] ) )"
    for extra, foot in (("", 2.5), ("stack_children 0", 0.5)):
        parent, child = load(text.format(extra)).obstacles
        assert child.pose == pytest.approx((1, 2, math.pi / 2))
        assert child.shapes[0].z_min == pytest.approx(foot)
        assert (parent.name, child.name) == ("model:0", "model:0.model:0")


def test_surfaces(load: Load) -> None:
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


def test_blocks_replace_the_box(load: Load) -> None:
    """A model with blocks has just these, fitted to its size; z is 0 to 1 by default."""
    triangle = "block ( points 3 point[0] [0 0] point[1] [2 0] point[2] [0 2] )"
    (obstacle,) = load(f"model ( size [4 4 1] {triangle} )").obstacles
    assert obstacle.shapes[0].points == ((-2, -2), (2, -2), (-2, 2))
    assert (obstacle.shapes[0].z_min, obstacle.shapes[0].z_max) == (0, 1)


def test_odd_blocks_are_mended_with_a_remark(load: Load) -> None:
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


def test_noblocks_and_boundary(load: Load) -> None:
    """`noblocks` takes the box away that a model has without a word, and it alone; `boundary` puts slabs round it."""
    block = "block ( points 3 point[0] [0 0] point[1] [2 0] point[2] [0 2] )"
    text = f"model ( noblocks 1 )\nmodel ( noblocks 1 boundary 1 size [4 2 1] )\nmodel ( noblocks 1 {block} )"
    assert [len(obstacle.shapes) for obstacle in load(text).obstacles] == [4, 1]


def test_a_flat_map_is_loaded_and_seen_by_no_laser(load: Load, bitmap: str) -> None:
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
def test_a_body_without_an_area_is_none(load: Load, bitmap: str, size: str) -> None:
    """A line is nothing that could be met, of a box, a map and a robot; each is said."""
    world = load(f'model ( size {size} )\nmodel ( bitmap "{bitmap}" size {size} )', f"\nposition ( size {size} )")
    assert (world.floorplans, world.obstacles, world.robots[0].shapes) == ((), (), ())
    assert world.robots[0].wheel_separation > 0
    assert [remark.text.split(" m ")[1] for remark in world.warnings] == ["is no obstacle, and no laser sees it"] * 3
    Engine(world).step({0: Twist(Vector3(1.0))})


@pytest.mark.parametrize(
    ("text", "read", "remark"),
    [
        ("position ( name 0 )", lambda robot: robot.name == "0", None),
        ("position ( name 007 )", lambda robot: robot.name == "007", None),
        ('position ( name ["a" "b"] )', lambda robot: robot.name == "a", None),
        ('position ( color 5 mass "3.5" )', lambda robot: (robot.color, robot.mass) == ("5", 3.5), None),
        ("position ( pose [3.75.2 0 0 0] )", lambda robot: robot.pose.x == 3.75, "1:18: '3.75.2' is not a number"),
        ('position ( drive "tracks" )', lambda robot: robot.drive == "diff", "1:12: drive is one of diff, omni, car"),
        ('position ( localization "x" )', lambda robot: robot.localization == "gps", "1:12: localization is one of"),
        ('unit_length "inch"\nposition ( pose [1 0 0 0] )', lambda robot: robot.pose.x == 1, "1:1: unit_length is one"),
        ("position ( mass 0 )", lambda robot: robot.mass == 10, "1:12: mass must be above 0, not 0: 10 kg is taken"),
        ("position ( wheelbase 0 )", lambda robot: robot.drive == "diff", None),
        ('position ( odom_error [-0.1 0 0 0] )', lambda robot: robot.odom_error[0] == -0.1, None),
        ("position ( obstacle_return 0.9 )", lambda robot: not robot.shapes[0].obstacle, "1:12: obstacle_return is a"),
        ("position ( window ( size [1 1] ) )", lambda robot: len(robot.shapes) == 1, None),
    ],
)  # fmt: skip
def test_what_stage_loads_is_loaded(load: Load, text: str, read: Callable[[Robot], bool], remark: str | None) -> None:
    """Numbers as text, words that Stage does not know, values that it does not use: as there, said where it matters."""
    world = load(text, "")
    assert read(world.robots[0])
    found = [str(remark).partition("w.world:")[2] for remark in world.warnings]
    assert len(found) == (remark is not None) and all(text.startswith(remark or "") for text in found)


@pytest.mark.parametrize(
    ("sensor", "read", "remark"),
    [
        ("samples 2.5 fov 90", (2, 0, 5), "samples is a whole number: 2 is taken of 2.5, as Stage does"),
        ("samples 7 fov 0", (1, 0, 5), "all 7 rays of a fov of 0 are one: one is taken"),
        ("range [2 1]", (1, 0, 1), "the smallest range 2 is not of 0 to 1: 0 is taken, Stage never applies it"),
        ("range [-1 1]", (1, 0, 1), "the smallest range -1 is not of 0 to 1: 0 is taken, Stage never applies it"),
        ("samples 0", None, "a sensor without rays is left out"),
    ],
)
def test_odd_sensors_are_mended_with_a_remark(
    load: Load, sensor: str, read: tuple[int, float, float] | None, remark: str
) -> None:
    """Numbers that Stage cuts or does not apply leave a sensor that works, or none; the file is told."""
    world = load(f"position ( ranger ( sensor ( {sensor} ) ) )", "")
    found = [(ranger.samples, ranger.range_min, ranger.range_max) for ranger in world.robots[0].rangers]
    assert found == ([read] if read else [])
    assert [remark.text for remark in world.warnings] == [remark]


def test_points_that_a_block_lacks_are_at_its_origin(load: Load) -> None:
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


def test_blocks_without_a_height_are_flat(load: Load) -> None:
    """`z [0 0]` is a mark on the ground, as Stage has it."""
    corners = "points 3 point[0] [0 0] point[1] [1 0] point[2] [0 1]"
    world = load(f"model ( size [1 1 1] block ( {corners} z [0 0] ) )")
    assert [(shape.z_min, shape.z_max) for shape in world.obstacles[0].shapes] == [(0, 0)]
    assert [remark.text[:17] for remark in world.warnings] == ["this body is flat"]


def test_a_robot_and_its_rangers(load: Load) -> None:
    """The body lies about `origin`, children hang at the pose; rays leave half a sensor above the ranger's foot."""
    ranger = "ranger ( pose [0.05 0 {z} 0] sensor ( range [0 30] fov 270.25 samples 1081 ) )"
    for z, height in ((0, 0.26), (-0.1, 0.16)):
        (robot,) = load(f"{ROBOT} pose [1 2 0 180] {ranger.format(z=z)} )", "").robots
        assert robot.pose == pytest.approx((1, 2, math.pi))
        assert box_of(robot.shapes[0]) == pytest.approx((-0.225, -0.175, 0.125, 0.175))
        (laser,) = robot.rangers
        assert (laser.x, laser.y, laser.yaw, laser.z) == pytest.approx((0.05, 0, 0, height))
        assert (laser.samples, laser.range_min, laser.range_max) == (1081, 0, 30)
        assert laser.fov == pytest.approx(math.radians(270.25))


def test_a_rangers_own_body_pose_and_origin(load: Load) -> None:
    """A ranger has a body if it has blocks; its `origin` moves its sensors, and sensors add up poses."""
    block = "block ( points 4 point[0] [0 0] point[1] [0 1] point[2] [1 1] point[3] [1 0] z [0 0.21] )"
    sensor = "sensor ( pose [1 0 0.1 90] size [0 0 0.04] )"
    text = f"ranger ( pose [1 0 0 90] origin [0 0.5 0.2 0] size [0.2 0.1 0.3] {block} {sensor} sensor () )"
    (robot,) = load(f"position ( size [1 1 1] {text} )", "").robots
    assert box_of(robot.shapes[1]) == pytest.approx((0.45, -0.1, 0.55, 0.1))
    assert (robot.shapes[1].z_min, robot.shapes[1].z_max) == pytest.approx((1.2, 1.5))
    first, second = robot.rangers
    assert (first.x, first.y, first.z, abs(first.yaw)) == pytest.approx((0.5, 1, 1.32, math.pi))
    assert (second.x, second.y, second.z, second.yaw) == pytest.approx((0.5, 0, 1.21, math.pi / 2))
    assert (second.samples, second.range_max, second.fov) == (1, 5, 0.1)
    assert (first.name, second.name) == ("robot_0.ranger:0.0", "robot_0.ranger:0.1")


def test_the_laser_of_older_worlds(load: Load) -> None:
    """`laser` is a ranger; without a sensor its properties stand in the model itself."""
    (robot,) = load("position ( laser ( range_max 20 fov 90 samples 91 size [0.1 0.1 0.2] ) laser() )", "").robots
    first, second = robot.rangers
    assert (first.samples, first.range_max, first.z) == pytest.approx((91, 20, 0.2))
    assert (second.samples, second.range_max, second.fov) == pytest.approx((180, 8, math.pi))
    (robot,) = load("position ( laser ( sensor ( samples 5 ) ) )", "").robots
    assert robot.rangers[0].samples == 5


def test_robots_are_all_positions_in_file_order_at_any_depth(load: Load) -> None:
    """A robot on a model or on a robot is a robot too, at its place in the world."""
    text = 'position ( name "a" pose [1 0 0 90] position ( pose [1 0 0 0] ) )\nmodel ( pose [0 5 0 0] position () )'
    robots = load(text, "").robots
    assert [robot.name for robot in robots] == ["a", "robot_1", "robot_2"]
    assert robots[1].pose == pytest.approx((1, 1, math.pi / 2))
    assert robots[2].pose == pytest.approx((0, 5, 0))
    assert [len(robot.shapes) for robot in robots] == [1, 1, 1]


def test_how_a_robot_drives(load: Load) -> None:
    """Drive, limits, odometry, mass and colour come from the file; degrees become radians."""
    (robot,) = load(
        'position ( drive "omni" wheelbase 0.5 velocity_bounds [-0.5 0.7 -0.1 0.1 0 0 -90 180] '
        'acceleration_bounds [-1 1 0 0 0 0 -90 90] localization "odom" odom_error [0.1 0.2 0 0.3] mass 23 '
        'color "blue" )',
        "",
    ).robots
    assert (robot.drive, robot.wheelbase, robot.mass, robot.color) == ("omni", 0.5, 23, "blue")
    assert robot.velocity == Limits((-0.5, 0.7), (-0.1, 0.1), (-math.pi / 2, math.pi))
    assert robot.acceleration == Limits((-1, 1), (0, 0), (-math.pi / 2, math.pi / 2))
    assert robot.localization == "odom"
    assert robot.odom_error == pytest.approx((0.1, 0.2, math.radians(0.3)))


def test_the_yaw_share_of_odom_error_is_scaled_by_the_angle_unit(load: Load) -> None:
    """As in Stage: in degrees 5.73 is a share of 0.1, in radians 0.1 is; the shares of x and y are what they say."""
    for head, yaw in (("", "5.7296"), ('unit_angle "radians" unit_length "cm"', "0.1")):
        (robot,) = load(f"{head}\nposition ( odom_error [0.2 0.3 0 {yaw}] )", "").robots
        assert robot.odom_error == pytest.approx((0.2, 0.3, 0.1), abs=1e-5)


def test_the_defaults_of_a_robot_are_stages(load: Load) -> None:
    """Without a word in the file a robot is a diff drive of at most 1 m/s and 90 °/s, localised by "gps"."""
    (robot,) = load("position ( color_rgba [1 0.5 0 0.3] odom_error [0 0 90] )", "").robots
    assert (robot.drive, robot.localization, robot.acceleration) == ("diff", "gps", None)
    assert robot.velocity == Limits((-1, 1), (-1, 1), (-math.pi / 2, math.pi / 2))
    assert robot.color == "#ff8000"
    assert robot.odom_error == (0, 0, math.pi / 2)


def test_units_hold_for_the_whole_file(load: Load) -> None:
    """`unit_length` and `unit_angle` scale lengths and angles wherever they stand, and nothing else."""
    world = load(
        'model ( size [100 200 300] pose [10 0 0 1] )\nunit_length "cm" unit_angle "radians"',
        "\nposition ( ranger ( sensor ( range [0 800] fov 3 samples 7 ) ) )",
    )
    assert box_of(world.obstacles[0].shapes[0]) == (-0.5, -1, 0.5, 1)
    assert world.obstacles[0].pose == pytest.approx((0.1, 0, 1))
    assert (world.robots[0].rangers[0].range_max, world.robots[0].rangers[0].fov) == (8, 3)


@pytest.fixture
def bitmap(tmp_path: Path) -> str:
    """Name of a 10 × 8 bitmap: pixels x 2..5, y 1..6 from below are black, but one in the middle."""
    pixels = np.full((8, 10), 255, np.uint8)
    pixels[1:7, 2:6] = 0
    pixels[3, 3] = 205
    Image.fromarray(pixels).save(tmp_path / "b.png")
    return "b.png"


def test_a_bitmap_is_cropped_and_stretched_like_stage(load: Load, bitmap: str) -> None:
    """By default the box of black pixels fills the model's size, whatever margin the image has."""
    (floor,) = load(f'model ( name "m" bitmap "{bitmap}" size [8 3 2] pose [10 20 1 0] )').floorplans
    assert floor.name == "m"
    assert floor.occupied.shape == (6, 4)
    assert not floor.occupied[3, 1]
    assert floor.occupied.sum() == 23
    assert floor.cell == (2, 0.5)
    assert floor.pose == (6, 18.5, 0)
    assert (floor.z_min, floor.z_max) == (1, 3)


def test_a_bitmap_can_be_read_as_a_whole(load: Load, bitmap: str) -> None:
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


def test_a_floors_pose_is_its_lower_left_corner(load: Load, bitmap: str) -> None:
    """The model's rotation and origin apply: cells keep the bitmap's own axes."""
    (floor,) = load(f'model ( bitmap "{bitmap}" size [4 2 1] origin [1 0 0 0] pose [10 0 0 90] )').floorplans
    assert floor.pose == pytest.approx((11, -1, math.pi / 2))


def test_a_floor_may_have_a_boundary(load: Load, bitmap: str) -> None:
    """The slabs of `boundary 1` are an obstacle of their own, as high as the floor, with its surface."""
    world = load(f'model ( name "m" bitmap "{bitmap}" size [4 2 1] boundary 1 ranger_return 0.5 obstacle_return 0 )')
    (slabs,) = world.obstacles
    assert slabs.name == "m.boundary"
    assert [(s.z_max, s.ranger_return, s.obstacle) for s in slabs.shapes] == [(1, 0.5, False)] * 4
    assert (world.floorplans[0].ranger_return, world.floorplans[0].obstacle) == (0.5, False)


def test_a_bitmap_on_a_robot_becomes_rectangles(load: Load, bitmap: str) -> None:
    """A robot's body cannot be a floor: its black cells are covered by boxes of the right total area."""
    (robot,) = load(f'position ( bitmap "{bitmap}" size [4 6 1] )', "").robots
    boxes = [box_of(shape) for shape in robot.shapes]
    assert sum((right - left) * (top - bottom) for left, bottom, right, top in boxes) == pytest.approx(23)


def test_a_fine_bitmap_on_a_robot_is_taken_as_its_box(load: Load, tmp_path: Path) -> None:
    """Hundreds of specks are too much for a body that moves; the remark says what is done."""
    Image.fromarray((np.indices((40, 40)).sum(axis=0) % 2 * 255).astype(np.uint8)).save(tmp_path / "c.png")
    world = load('position ( bitmap "c.png" size [1 1 1] )', "")
    assert [box_of(shape) for shape in world.robots[0].shapes] == [(-0.5, -0.5, 0.5, 0.5)]
    assert "its box is taken" in world.warnings[0].text


def test_remarks_say_what_does_nothing(load: Load) -> None:
    """Controllers, unknown words and devices that zteam has not are remarked with their place, window and gui not."""
    world = load(
        "window ( size [1 1] foo 1 )\nresolution 0.02\nquit_time 10\nmodel ( gui_nose 1 sise [1 1 1] )\n"
        'position ( ctrl "wander"\n camera ( fov [70 40] ) ranger ( alwayson 1 sensor ( sampels 2 ) ) ranger () )',
        "",
    )
    assert [str(remark).partition("w.world:")[2] for remark in world.warnings] == [
        "3:1: quit_time is ignored: the world does not end by itself: end a run with --for SECONDS",
        "4:20: unknown property 'sise' is ignored (did you mean 'size'?)",
        "5:12: ctrl is ignored: controllers of Stage are not run: every robot's process is its controller",
        "6:2: cameras are not simulated",
        "6:54: unknown property 'sampels' is ignored (did you mean 'samples'?)",
        "6:68: this ranger has no sensor( )",
    ]


def test_a_macro_used_often_is_remarked_once(load: Load) -> None:
    """A hundred robots of one macro give one remark for each of its places."""
    world = load('define r position ( ctrl "x" camera () )\n' + "r ()\n" * 100, "")
    assert len(world.warnings) == 2


def test_values_that_change_nothing_are_not_remarked(load: Load) -> None:
    """What a remarked property's default says needs no remark."""
    assert load("quit_time 0", "\nposition ( velocity [0 0 0 0] localization_origin [0 0 0 0] )").warnings == ()
    assert len(load("", "\nposition ( velocity [1 0 0 0] localization_origin [0 0 0 9] )").warnings) == 2


def test_a_device_without_a_simulation_keeps_its_body(load: Load) -> None:
    """A gripper is a box on its robot; a camera or a fiducial finder has no body."""
    world = load("position ( gripper ( size [0.1 0.1 0.1] ) camera () fiducial () )", "")
    assert len(world.robots[0].shapes) == 2


def test_a_bitmap_without_a_black_pixel(load: Load, tmp_path: Path) -> None:
    """There is no box to crop to, and so no body, as in Stage; as a whole image it is an empty floor."""
    Image.fromarray(np.full((4, 4), 255, np.uint8)).save(tmp_path / "white.png")
    world = load('model ( bitmap "white.png" )\nmodel ( bitmap "white.png" boundary 1 )')
    assert (world.floorplans, len(world.obstacles)) == ((), 1)
    assert ["has no occupied pixel" in remark.text for remark in world.warnings] == [True, True]
    world = load('model ( bitmap "" )')
    assert (world.floorplans, world.obstacles) == ((), ())
    assert [str(remark).partition("w.world:")[2] for remark in world.warnings] == ["1:9: no bitmap is named: no body"]
    assert not load('model ( bitmap "white.png" )', whole_bitmaps=True).floorplans[0].occupied.any()
