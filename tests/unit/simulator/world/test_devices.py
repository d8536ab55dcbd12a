"""Devices, markers and things to push in world files, and the colours of models."""

import pytest

from support.world_texts import LoadText
from zteam.errors import WorldError
from zteam.simulator.world.colors import find_color, random_color
from zteam.simulator.world.devices import Blobfinder, BumperPiece, Finder


def test_a_fiducial_finder_has_stages_defaults_and_its_own_values(load: LoadText) -> None:
    """It stands on the robot, in the base's frame; lengths and angles are converted."""
    text = "position ( size [1 1 0.4] fiducial ( pose [0.1 0 -0.2 90] {} ) )"
    (finder,) = load(text.format("")).robots[0].devices_of(Finder)
    assert (finder.x, finder.z, finder.range_max, finder.range_max_id) == (0.1, pytest.approx(0.2), 8.0, 5.0)
    assert (finder.fov, finder.yaw) == (pytest.approx(3.14159, abs=1e-4), pytest.approx(1.5708, abs=1e-4))
    given = "range_min 1 range_max 6 range_max_id 2 fov 90 fiducial_key 3 ignore_zloc 1".replace(" r", "\nr")
    (finder,) = (
        load(text.format("\n" + given.replace(" f", "\nf").replace(" i", "\ni") + "\n")).robots[0].devices_of(Finder)
    )
    assert (finder.range_min, finder.range_max, finder.range_max_id, finder.key) == (1.0, 6.0, 2.0, 3)
    assert finder.ignore_zloc


def test_bumpers_are_pieces_that_face_outward(load: LoadText) -> None:
    """Each bpose is a centre and a facing direction; blength holds for all, or for one."""
    text = """position ( size [1 1 0.4]
      bumper ( pose [0 0 -0.4 0]
        bcount 2
        blength 0.3
        blength[1] 0.5
        bpose[0] [0.5 0 0.1 0]
        bpose[1] [-0.5 0 0.1 180]
      ) )"""
    front, rear = load(text).robots[0].devices_of(BumperPiece)
    assert (front.x, front.z, front.length) == (0.5, pytest.approx(0.1), 0.3)
    assert (rear.length, abs(rear.yaw)) == (0.5, pytest.approx(3.14159, abs=1e-4))
    (*_, third) = load(text.replace("bcount 2", "bcount 3")).robots[0].devices_of(BumperPiece)
    assert (third.x, third.yaw, third.length) == (0, 0, 0.3)


def test_a_blobfinder_is_one_row_of_pixels(load: LoadText) -> None:
    """Its image's width, its colours, and a pan that turns it."""
    text = 'position ( blobfinder ( image [120 90] colors ["red" "blue"] colors_count 2 range 7 fov 80 pan 10 ) )'
    (finder,) = (
        load(text.replace(" colors_", "\ncolors_").replace(" range", "\nrange")).robots[0].devices_of(Blobfinder)
    )
    assert (finder.samples, finder.colors, finder.range_max) == (120, ("red", "blue"), 7.0)
    assert finder.yaw == pytest.approx(0.17453, abs=1e-4)
    indexed = 'position ( blobfinder ( colors_count 2\ncolors[0] "red"\ncolors[1] "green" ) )'
    assert load(indexed).robots[0].devices_of(Blobfinder)[0].colors == ("red", "green")
    with pytest.raises(WorldError, match=r"w.world:1:.* image"):
        load("position ( blobfinder ( image [0 60] ) )")


def test_devices_without_a_robot_are_remarked(load: LoadText) -> None:
    """A finder on a box does nothing, and says so."""
    assert "no robot carries" in str(load("model ( fiducial ( ) )\nposition ( )").warnings[0])


def test_fiducial_returns_are_markers(load: LoadText) -> None:
    """Robots, what they carry and things that stand still bear markers; 0, the default, is none."""
    world = load("model ( fiducial_return 4\nfiducial_key 2 )\nposition ( model ( pose [1 0 0 0] fiducial_return 7 ) )")
    (marker,) = world.obstacles[0].markers
    assert (marker.id, marker.key) == (4, 2)
    (carried,) = world.robots[0].markers
    assert (carried.id, carried.x) == (7, 1.0)


def test_what_can_be_pushed_moves_as_one(load: LoadText) -> None:
    """A pushable model takes along what stands on it; robots and bitmaps are not pushable."""
    world = load(
        'model ( name "cart" pushable 1\nmass 3\npose [2 0 0 0] size [1 1 1] model ( pose [0 0 0 0] ) )\nposition ( )'
    )
    (cart,) = world.obstacles
    assert (cart.name, cart.mass, len(cart.shapes), cart.pose.x) == ("cart", 3.0, 2, 2.0)
    with pytest.raises(WorldError, match="moved by its drive"):
        load("position ( pushable 1 )")


def test_wheels_alphas_and_physics_are_zteams_own(load: LoadText) -> None:
    """They are read where Stage has no such thing; the wheels are as far apart as the base is wide by default."""
    world = load('physics "kinematic"\nposition ( size [0.5 0.4 0.2] odom_alphas [0.1 0.2 0.3 0.4] wheel_radius 0.07 )')
    robot = world.robots[0]
    assert (world.physics, robot.odom_alphas) == ("kinematic", (0.1, 0.2, 0.3, 0.4))
    assert (robot.wheel_radius, robot.wheel_separation) == (0.07, 0.4)
    for wrong in ('physics "soft"\nposition ( )', "position ( odom_alphas [1 1 1 -1] )", "position ( wheel_radius 0 )"):
        with pytest.raises(WorldError, match=r"w\.world:"):
            load(wrong)


def test_colours_are_x11s(load: LoadText) -> None:
    """Names with and without blanks, shades, grays and hex; "random" belongs to the model."""
    assert find_color("NavyBlue") == (0.0, 0.0, 128 / 255)
    assert find_color("light blue") == find_color("LightBlue")
    assert find_color("gray30") == (0.3, 0.3, 0.3)
    assert find_color("red3") == pytest.approx((0.804, 0.0, 0.0))
    assert find_color("#ff8000") == (1.0, 128 / 255, 0.0)
    assert find_color("no such colour") is None
    assert find_color("gray900") is None
    first, second, _ = (r.color for r in load('position ( color "random" )\nposition ( color "random" )').robots)
    assert first != second
    assert find_color(first) is not None
    assert random_color("a") == random_color("a")
