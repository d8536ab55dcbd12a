"""The entries of a team file as messages and as arguments of `zteam-robot`."""

import argparse
import math
from pathlib import Path

import pytest

from support.team_files import WHOLE, load
from zteam.cli.zteam_robot import build_parser, parse_param, read_base
from zteam.errors import UsageError
from zteam.geometry import yaw_from_quaternion
from zteam.team_file import RobotEntry, robot_arguments, static_transform


def test_static_transforms_become_messages(tmp_path: Path) -> None:
    """Angles and quaternions both become unit quaternions; a leading slash is removed."""
    camera, dock = map(static_transform, load(tmp_path, WHOLE).static_transforms)
    assert (camera.header.frame_id, camera.child_frame_id) == ("robot_0/base_link", "robot_0/camera")
    assert camera.transform.translation.x == 0.1
    turn = camera.transform.rotation
    assert yaw_from_quaternion(turn.x, turn.y, turn.z, turn.w) == pytest.approx(1.5)
    turn = dock.transform.rotation
    assert yaw_from_quaternion(turn.x, turn.y, turn.z, turn.w) == pytest.approx(math.pi / 2)
    assert math.hypot(turn.x, turn.y, turn.z, turn.w) == pytest.approx(1.0, abs=1e-15)


VALUES = """
[[robots]]
id = 3
behavior = "my.robots:Dance"
a = 0.1
b = -2
c = true
d = 'say "hi"\t#x = 1'
e = [1, [2.5, 'x']]
f = { 'two words' = 'ü😀', g = false }
h = 1e300
i = "\\u007f\\u0000\\\\ \\n"
"""


def test_arguments_bring_the_same_parameters_to_the_robot(tmp_path: Path) -> None:
    """zteam-robot reads from its command line every TOML value that the parameter has in the file."""
    robot = load(tmp_path, VALUES).robots[0]
    args: argparse.Namespace = build_parser().parse_args(robot_arguments(robot))
    assert (args.id, args.behavior, args.follow) == ("3", "my.robots:Dance", None)
    assert dict(map(parse_param, args.param)) == robot.params
    assert len(robot.params) == 8


BASES = """
[[robots]]
id = 0
speed = 0.2
[robots.base]
footprint = [[-0.3, -0.2], [0.4, -0.2], [0.4, 0.2], [-0.3, 0.2]]
max_vel_x = 0.5
decel_lim_x = -inf

[[robots]]
id = 1
base = {min_vel_x = 0}
"""


def test_arguments_bring_the_base_to_the_robot(tmp_path: Path) -> None:
    """zteam-robot reads from its command line what the table [robots.base] sets, and no more."""
    for robot in load(tmp_path, BASES).robots:
        assert read_base(build_parser().parse_args(robot_arguments(robot)).base) == robot.base
    first, second = load(tmp_path, BASES).robots
    assert (first.base.max_vel_x, first.base.decel_lim_x, first.base.max_vel_theta) == (0.5, -math.inf, None)
    assert robot_arguments(second) == ["--id", "1", "--base", "min_vel_x=0.0"]


def test_arguments_leave_the_safety_layer_out_where_the_file_does(tmp_path: Path) -> None:
    """`safety = false` becomes --no-safety, for that robot alone."""
    robots = load(tmp_path, "[[robots]]\nid = 0\nsafety = false\n[[robots]]\nid = 1\n").robots
    assert [build_parser().parse_args(robot_arguments(robot)).no_safety for robot in robots] == [True, False]


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("max_vel_x", "--base 'max_vel_x' is not KEY=VALUE, e.g. --base max_vel_x=0.4"),
        ("max_vel_z=1.0", "--base max_vel_z: unknown key (did you mean max_vel_y?); known: footprint, max_vel_x"),
        ("max_vel_x=fast", '--base max_vel_x: a number is expected, not "fast"'),
        ("footprint=[[0, 0], [1, 0], [2, 0]]", "--base footprint: must enclose an area"),
    ],
)
def test_a_wrong_base_on_the_command_line_is_told(text: str, told: str) -> None:
    """One line that names the option and the key."""
    with pytest.raises(UsageError) as caught:
        read_base([text])
    assert str(caught.value).startswith(told)


def test_a_robot_without_a_behaviour_has_only_its_id() -> None:
    """zteam-robot then runs its default behaviour."""
    assert robot_arguments(RobotEntry(id=4)) == ["--id", "4"]
    assert robot_arguments(RobotEntry(id=4, behavior="avoid")) == ["--id", "4", "--behavior", "avoid"]
