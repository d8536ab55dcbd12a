"""The tree as a picture, and the figures of its stream."""

import xml.etree.ElementTree as ET

import pytest
from test_tf_buffer import S, stamped

from zteam.tf import FrameInfo
from zteam.tf.drawing import tree_as_dot, tree_as_svg
from zteam.tf.watching import Watch

FRAMES = {
    "odom": FrameInfo("map", "sim", True, 0.0, 0, 0, 1),
    "base": FrameInfo("odom", "robot<0>", False, 10.0, S, 9 * S, 81),
    'odd "name"': FrameInfo("map", "file", False, 5.0, S, 5 * S, 21),
}


def test_the_svg_is_well_formed_and_shows_what_is_broken() -> None:
    """A box for every frame, a line for every edge, red for the one without news; names are escaped."""
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
    """No two boxes are in one place, and every child is further down than its parent."""
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
    """Two thousand frames in a row need no stack."""
    frames = {f"f{i}": FrameInfo(f"f{i - 1}", "t", True, 0.0, 0, 0, 1) for i in range(1, 2001)}
    assert tree_as_svg(frames, 0).count('rx="6"') == 2001


def test_a_watch_measures_rate_jitter_and_delay() -> None:
    """Stamps 0.1, 0.1 and 0.4 s apart: 5 Hz, their spread, and how late they came by the team's clock."""
    watch = Watch()
    for stamp, now in ((S, 0), (S + S // 10, S + S // 5), (S + S // 5, S + S // 5), (S + 3 * S // 5, S)):
        watch.take([stamped("odom", "base", stamp)], now)
    (figures,) = watch.figures()
    assert (figures.parent, figures.child, figures.count) == ("odom", "base", 4)
    assert figures.rate == pytest.approx(5.0)
    assert figures.jitter == pytest.approx(0.141421, abs=1e-5)
    assert figures.mean_delay == pytest.approx(0.1 / 3)
    assert figures.max_delay == pytest.approx(0.1)
    watch.take([stamped("odom", "other", S)], 0)
    lonely = watch.figures()[1]
    assert (lonely.rate, lonely.jitter, lonely.mean_delay) == (None, None, None)
