"""Transforms and trees as text."""

import math

from support.transforms import S, stamped
from zteam.messages import TFMessage
from zteam.tf import Buffer
from zteam.tf.merge import Merger
from zteam.tf.text import format_transform, format_tree


def test_tf_echos_block() -> None:
    """The block has tf_echo's format, without -0.000."""
    text = format_transform(stamped("map", "robot_0/base_footprint", 3 * S // 2, 6.5, -0.0001))
    assert text.splitlines() == [
        "At time 1.500",
        "- Translation: [6.500, 0.000, 0.000]",
        "- Rotation: in Quaternion [0.000, 0.000, 0.000, 1.000]",
        "            in RPY (radian) [0.000, 0.000, 0.000]",
        "            in RPY (degree) [0.000, 0.000, 0.000]",
    ]


def test_tf_echos_angles_are_fixed_axis() -> None:
    """Roll, pitch and yaw are printed in radians, then in degrees."""
    transform = stamped("map", "base", 0, -1.0, 2.5, math.radians(-90))
    lines = format_transform(transform).splitlines()
    assert lines[1] == "- Translation: [-1.000, 2.500, 0.000]"
    assert lines[2] == "- Rotation: in Quaternion [0.000, 0.000, -0.707, 0.707]"
    assert lines[3].strip() == "in RPY (radian) [0.000, 0.000, -1.571]"
    assert lines[4].strip() == "in RPY (degree) [0.000, 0.000, -90.000]"


def test_the_tree_in_a_terminal() -> None:
    """Every frame is on a line below its parent, with rate, age and authority."""
    merger = Merger()
    merger.take_static(0, TFMessage([stamped("map", "odom", 0)]))
    for tick in range(1, 12):
        merger.take(0, TFMessage([stamped("odom", "base_footprint", tick * S // 10)]))
    assert format_tree(merger.buffer.frames(), 12 * S // 10).splitlines() == [
        "map",
        "└── robot_0/odom  (static, by robot_0)",
        "    └── robot_0/base_footprint  (10.0 Hz, 0.10 s old, by robot_0)",
    ]


def test_several_roots_and_branches_in_a_terminal() -> None:
    """Unconnected trees follow one another, branches are drawn as lines, and every frame is printed."""
    buffer = Buffer()
    for parent, child in (("map", "a"), ("a", "a1"), ("a", "a2"), ("map", "b"), ("moon", "crater")):
        buffer.set_transform_static(stamped(parent, child, 0), "me")
    assert format_tree(buffer.frames(), 0).splitlines() == [
        "map",
        "├── a  (static, by me)",
        "│   ├── a1  (static, by me)",
        "│   └── a2  (static, by me)",
        "└── b  (static, by me)",
        "moon",
        "└── crater  (static, by me)",
    ]
    assert format_tree({}, 0) == ""


def test_a_tree_of_any_depth_is_drawn() -> None:
    """A chain deeper than Python's stack is printed."""
    buffer = Buffer()
    for i in range(1500):
        buffer.set_transform_static(stamped(f"f{i}", f"f{i + 1}", 0), "me")
    assert len(format_tree(buffer.frames(), 0).splitlines()) == 1501
