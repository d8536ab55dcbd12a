"""Transforms as text, and the tree as text and as a picture."""

import math
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest
from PIL import Image

from support.transforms import S, stamped
from zteam.errors import UsageError
from zteam.tf import Buffer, FrameInfo
from zteam.transforms.drawing import PICTURES, draw_tree, format_transform, format_tree

FRAMES = {
    "odom": FrameInfo("map", "sim", True, 0.0, 0, 0, 1),
    "base": FrameInfo("odom", "robot<0>", False, 10.0, S, 9 * S, 81),
    'odd "name"': FrameInfo("map", "file", False, 5.0, S, 5 * S, 21),
}


def test_tf_echos_block() -> None:
    """The block has tf_echo's format, without -0.000; angles are in radians, then in degrees."""
    text = format_transform(stamped("map", "robot_0/base_footprint", 3 * S // 2, 6.5, -0.0001, math.radians(-90)))
    assert text.splitlines() == [
        "At time 1.500",
        "- Translation: [6.500, 0.000, 0.000]",
        "- Rotation: in Quaternion [0.000, 0.000, -0.707, 0.707]",
        "            in RPY (radian) [0.000, 0.000, -1.571]",
        "            in RPY (degree) [0.000, 0.000, -90.000]",
    ]


def test_several_roots_and_branches_in_a_terminal() -> None:
    """Unconnected trees follow one another, branches are lines, and every frame has its figures."""
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
    assert "base  (10.0 Hz, 1.00 s old, by robot<0>)" in format_tree(FRAMES, 10 * S)


def test_the_svg_shows_what_is_broken(tmp_path: Path) -> None:
    """Each edge has a line, which is dashed and red without recent samples; names are escaped. Each frame has a box,
    below its parent's and beside its siblings'."""
    draw_tree(FRAMES, 9 * S, tmp_path / "tree.svg")
    root = ET.fromstring((tmp_path / "tree.svg").read_text())
    texts = [element.text for element in root.iter() if element.tag.endswith("text")]
    assert {"map", "odom", "base", 'odd "name"', "robot<0>", "5.0 Hz, 4.00 s old"} <= set(texts)
    lines = [element for element in root.iter() if element.tag.endswith("polyline")]
    assert sorted(line.get("stroke-dasharray") is not None for line in lines) == [False, False, True]
    boxes = [str(element.get("points")) for element in root if element.tag.endswith("polygon")]
    places = [tuple(map(float, box.split()[0].split(","))) for box in boxes]
    base, map_, odd, odom = places  # by name
    assert map_[1] < odom[1] < base[1]
    assert odd[1] == odom[1]
    assert odd[0] != odom[0]
    draw_tree({}, 0, tmp_path / "none.svg")
    assert "nan" not in (tmp_path / "none.svg").read_text().lower()


def test_the_dot_file_names_every_edge(tmp_path: Path) -> None:
    """Quotes are escaped, and the broken edge is red."""
    draw_tree(FRAMES, 9 * S, tmp_path / "tree.dot")
    text = (tmp_path / "tree.dot").read_text()
    assert '"map" -> "odom" [label="sim\\nstatic"];' in text
    assert '"odd \\"name\\""' in text
    assert text.count("style=") == 1


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


def test_a_deep_chain_is_drawn(tmp_path: Path) -> None:
    """A chain deeper than Python's stack is printed and drawn, but has too many boxes for pixels; the error of a
    drawing that cannot be written names the file."""
    frames = {f"f{i}": FrameInfo(f"f{i - 1}", "t", True, 0.0, 0, 0, 1) for i in range(1, 1101)}
    assert len(format_tree(frames, 0).splitlines()) == 1101
    draw_tree(frames, 0, tmp_path / "tree.svg")
    assert (tmp_path / "tree.svg").read_text().count("<polygon") == 1101
    for tree, path, text in (
        (frames, "tree.png", "1101 frames, too many"),
        (FRAMES, "no/tree.png", "tree.png: cannot"),
    ):
        with pytest.raises(UsageError, match=text):
            draw_tree(tree, 0, tmp_path / path)
