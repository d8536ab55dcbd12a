"""zteam.world: robots with what they carry and how they drive, and what is said of values that do nothing."""

import math
from collections.abc import Callable

import pytest

from support.world_texts import LoadText, box_of
from zteam.world import Limits, Robot

ROBOT = "position ( size [0.35 0.35 0.25] origin [-0.05 0 0 0] "


def test_the_world_has_a_name_and_an_interval(load: LoadText) -> None:
    """`interval_sim` is milliseconds, 100 by default; the name is the file's unless it has one."""
    assert (load("").name, load("").interval) == ("w", 100_000_000)
    world = load('name "x" interval_sim 20.5')
    assert (world.name, world.interval) == ("x", 20_500_000)


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
def test_what_stage_loads_is_loaded(
    load: LoadText, text: str, read: Callable[[Robot], bool], remark: str | None
) -> None:
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
    load: LoadText, sensor: str, read: tuple[int, float, float] | None, remark: str
) -> None:
    """Numbers that Stage cuts or does not apply leave a sensor that works, or none; the file is told."""
    world = load(f"position ( ranger ( sensor ( {sensor} ) ) )", "")
    found = [(ranger.samples, ranger.range_min, ranger.range_max) for ranger in world.robots[0].rangers]
    assert found == ([read] if read else [])
    assert [remark.text for remark in world.warnings] == [remark]


def test_a_robot_and_its_rangers(load: LoadText) -> None:
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


def test_a_rangers_own_body_pose_and_origin(load: LoadText) -> None:
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


def test_the_laser_of_older_worlds(load: LoadText) -> None:
    """`laser` is a ranger; without a sensor its properties stand in the model itself."""
    (robot,) = load("position ( laser ( range_max 20 fov 90 samples 91 size [0.1 0.1 0.2] ) laser() )", "").robots
    first, second = robot.rangers
    assert (first.samples, first.range_max, first.z) == pytest.approx((91, 20, 0.2))
    assert (second.samples, second.range_max, second.fov) == pytest.approx((180, 8, math.pi))
    (robot,) = load("position ( laser ( sensor ( samples 5 ) ) )", "").robots
    assert robot.rangers[0].samples == 5


def test_robots_are_all_positions_in_file_order_at_any_depth(load: LoadText) -> None:
    """A robot on a model or on a robot is a robot too, at its place in the world."""
    text = 'position ( name "a" pose [1 0 0 90] position ( pose [1 0 0 0] ) )\nmodel ( pose [0 5 0 0] position () )'
    robots = load(text, "").robots
    assert [robot.name for robot in robots] == ["a", "robot_1", "robot_2"]
    assert robots[1].pose == pytest.approx((1, 1, math.pi / 2))
    assert robots[2].pose == pytest.approx((0, 5, 0))
    assert [len(robot.shapes) for robot in robots] == [1, 1, 1]


def test_how_a_robot_drives(load: LoadText) -> None:
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


def test_the_yaw_share_of_odom_error_is_scaled_by_the_angle_unit(load: LoadText) -> None:
    """As in Stage: in degrees 5.73 is a share of 0.1, in radians 0.1 is; the shares of x and y are what they say."""
    for head, yaw in (("", "5.7296"), ('unit_angle "radians" unit_length "cm"', "0.1")):
        (robot,) = load(f"{head}\nposition ( odom_error [0.2 0.3 0 {yaw}] )", "").robots
        assert robot.odom_error == pytest.approx((0.2, 0.3, 0.1), abs=1e-5)


def test_the_defaults_of_a_robot_are_stages(load: LoadText) -> None:
    """Without a word in the file a robot is a diff drive of at most 1 m/s and 90 °/s, localised by "gps"."""
    (robot,) = load("position ( color_rgba [1 0.5 0 0.3] odom_error [0 0 90] )", "").robots
    assert (robot.drive, robot.localization, robot.acceleration) == ("diff", "gps", None)
    assert robot.velocity == Limits((-1, 1), (-1, 1), (-math.pi / 2, math.pi / 2))
    assert robot.color == "#ff8000"
    assert robot.odom_error == (0, 0, math.pi / 2)


def test_units_hold_for_the_whole_file(load: LoadText) -> None:
    """`unit_length` and `unit_angle` scale lengths and angles wherever they stand, and nothing else."""
    world = load(
        'model ( size [100 200 300] pose [10 0 0 1] )\nunit_length "cm" unit_angle "radians"',
        "\nposition ( ranger ( sensor ( range [0 800] fov 3 samples 7 ) ) )",
    )
    assert box_of(world.obstacles[0].shapes[0]) == (-0.5, -1, 0.5, 1)
    assert world.obstacles[0].pose == pytest.approx((0.1, 0, 1))
    assert (world.robots[0].rangers[0].range_max, world.robots[0].rangers[0].fov) == (8, 3)


def test_remarks_say_what_does_nothing(load: LoadText) -> None:
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


def test_a_macro_used_often_is_remarked_once(load: LoadText) -> None:
    """A hundred robots of one macro give one remark for each of its places."""
    world = load('define r position ( ctrl "x" camera () )\n' + "r ()\n" * 100, "")
    assert len(world.warnings) == 2


def test_values_that_change_nothing_are_not_remarked(load: LoadText) -> None:
    """What a remarked property's default says needs no remark."""
    assert load("quit_time 0", "\nposition ( velocity [0 0 0 0] localization_origin [0 0 0 0] )").warnings == ()
    assert len(load("", "\nposition ( velocity [1 0 0 0] localization_origin [0 0 0 9] )").warnings) == 2
