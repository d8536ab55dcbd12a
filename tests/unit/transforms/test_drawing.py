"""Transforms as text, and the tree as text and as a picture."""

import math
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest
from PIL import Image

from support.transforms import S, stamped
from zteam.errors import UsageError
from zteam.messages import TFMessage
from zteam.tf import Buffer, FrameInfo
from zteam.transforms.drawing import PICTURES, draw_tree, format_transform, format_tree, tree_as_dot, tree_as_svg
from zteam.transforms.merge import Merger

FRAMES = {
    "odom": FrameInfo("map", "sim", True, 0.0, 0, 0, 1),
    "base": FrameInfo("odom", "robot<0>", False, 10.0, S, 9 * S, 81),
    'odd "name"': FrameInfo("map", "file", False, 5.0, S, 5 * S, 21),
}


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
    assert "base  (10.0 Hz, age unknown, by robot<0>)" in format_tree(FRAMES, 0)


def test_a_tree_of_any_depth_is_drawn() -> None:
    """A chain deeper than Python's stack is printed."""
    buffer = Buffer()
    for i in range(1500):
        buffer.set_transform_static(stamped(f"f{i}", f"f{i + 1}", 0), "me")
    assert len(format_tree(buffer.frames(), 0).splitlines()) == 1501


def test_the_svg_is_well_formed_and_shows_what_is_broken() -> None:
    """Each frame has a box and each edge a line; an edge without recent samples is red; names are escaped."""
    root = ET.fromstring(tree_as_svg(FRAMES, 9 * S))
    texts = [element.text for element in root.iter() if element.tag.endswith("text")]
    assert {"map", "odom", "base", 'odd "name"'} <= set(texts)
    assert "robot<0>" in texts
    assert "5.0 Hz, 4.00 s old" in texts
    paths = [element for element in root.iter() if element.tag.endswith("path")]
    assert len(paths) == 3
    assert [path.get("stroke-dasharray") is not None for path in paths].count(True) == 1
    assert "NaN" not in tree_as_svg({}, 0)


def test_children_lie_below_their_parents_and_side_by_side() -> None:
    """No two boxes overlap, and every child is below its parent."""
    root = ET.fromstring(tree_as_svg(FRAMES, 0))
    boxes = [e for e in root if e.tag.endswith("rect") and e.get("rx")]
    places = [(float(str(b.get("x"))), float(str(b.get("y")))) for b in boxes]
    assert len(set(places)) == 4
    base, map_, odd, odom = places  # by name
    assert map_[1] < odom[1] < base[1]
    assert odd[1] == odom[1]
    assert odd[0] != odom[0]


def test_the_dot_file_names_every_edge() -> None:
    """Quotes are escaped, and the broken edge is red."""
    text = tree_as_dot(FRAMES, 9 * S)
    assert '"map" -> "odom" [label="sim\\nstatic"];' in text
    assert '"odd \\"name\\""' in text
    assert text.count("style=") == 1


def test_a_deep_chain_is_drawn() -> None:
    """A chain of two thousand frames is drawn without recursion."""
    frames = {f"f{i}": FrameInfo(f"f{i - 1}", "t", True, 0.0, 0, 0, 1) for i in range(1, 2001)}
    assert tree_as_svg(frames, 0).count('rx="6"') == 2001


@pytest.mark.parametrize("ending", PICTURES)
def test_every_kind_of_file_is_written(ending: str, tmp_path: Path) -> None:
    """Each ending gives a file of that kind, also in capitals."""
    begins = {".svg": b"<svg ", ".png": b"\x89PNG", ".pdf": b"%PDF", ".dot": b"digraph"}
    for path in (tmp_path / f"tree{ending}", tmp_path / f"TREE{ending.upper()}"):
        draw_tree(FRAMES, 9 * S, path)
        assert path.read_bytes().startswith(begins[ending])


def test_a_png_shows_boxes_and_what_is_broken(tmp_path: Path) -> None:
    """The picture has the colour of boxes, and red where an edge has had no recent sample."""
    for name, now in (("fresh", 5 * S), ("stale", 9 * S)):
        draw_tree(FRAMES, now, tmp_path / f"{name}.png")
    fresh, stale = (Image.open(tmp_path / f"{name}.png").convert("RGB") for name in ("fresh", "stale"))
    counts = [{color: count for count, color in picture.getcolors(1 << 20) or ()} for picture in (fresh, stale)]
    box, red = (0xEE, 0xF3, 0xFB), (0xCC, 0, 0)
    assert all(colors[box] > 4 * 190 * 30 for colors in counts)
    assert red not in counts[0]
    assert counts[1][red] > 50


def test_a_tree_too_large_for_pixels_is_refused(tmp_path: Path) -> None:
    """A chain of two thousand frames has no PNG; the error names the kinds of file without pixels."""
    frames = {f"f{i}": FrameInfo(f"f{i - 1}", "t", True, 0.0, 0, 0, 1) for i in range(1, 2001)}
    with pytest.raises(UsageError, match=r"2001 frames, too many for pixels: name a \.svg or \.dot file"):
        draw_tree(frames, 0, tmp_path / "tree.png")


def test_a_file_that_cannot_be_written_is_a_usage_error(tmp_path: Path) -> None:
    """The error names the file."""
    with pytest.raises(UsageError, match="cannot write the tree"):
        draw_tree(FRAMES, 0, tmp_path / "missing" / "tree.png")
