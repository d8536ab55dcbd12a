"""The tree as a picture."""

import xml.etree.ElementTree as ET
from pathlib import Path

import pytest
from PIL import Image

from support.transforms import S
from zteam.errors import UsageError
from zteam.tf import FrameInfo
from zteam.tf.drawing import PICTURES, draw_tree, tree_as_dot, tree_as_svg

FRAMES = {
    "odom": FrameInfo("map", "sim", True, 0.0, 0, 0, 1),
    "base": FrameInfo("odom", "robot<0>", False, 10.0, S, 9 * S, 81),
    'odd "name"': FrameInfo("map", "file", False, 5.0, S, 5 * S, 21),
}


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
