"""The tree as a picture."""

import xml.etree.ElementTree as ET

from support.transforms import S
from zteam.tf import FrameInfo
from zteam.tf.drawing import tree_as_dot, tree_as_svg

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
