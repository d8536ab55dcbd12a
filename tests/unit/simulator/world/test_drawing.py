"""Pictures of worlds: the right things in the right places."""

import math
import re
import xml.etree.ElementTree as ET
from pathlib import Path

import msgspec
import numpy as np
import pytest
from PIL import Image

from support.small_worlds import make_box, make_maze, make_robot, make_world
from zteam.errors import UsageError
from zteam.geometry import Pose2
from zteam.simulator.world.drawing import Fan, draw_world
from zteam.simulator.world.model import Shape

GREEN = make_robot(
    1.0, -2.0, shapes=(Shape(((-0.3, -0.3), (0.3, -0.3), (0.3, 0.3), (-0.3, 0.3)), 0, 1, color="#00ff00"),)
)


def test_a_png_shows_walls_and_robots_where_they_are(tmp_path: Path) -> None:
    """Pixels at a wall's cell, at a robot and on free ground have the colours of these, also on a turned plan."""
    world = make_maze()
    for yaw in (0.0, 0.5):
        plan = msgspec.structs.replace(world.floorplans[0], pose=Pose2(-4.0, -4.0, yaw), color="#0000ff")
        turned = msgspec.structs.replace(world, floorplans=(plan,), robots=(GREEN,))
        path = tmp_path / f"maze_{yaw}.png"
        draw_world(turned, path, width=600)
        pixels = np.asarray(Image.open(path))
        cos, sin = math.cos(yaw), math.sin(yaw)
        corners = [(-4 + cos * u - sin * v, -4 + sin * u + cos * v) for u in (0, 8) for v in (0, 8)]
        corners += [(0.7, -2.3), (1.3, -1.7)]
        left, top = min(x for x, _ in corners) - 0.5, max(y for _, y in corners) + 0.5
        scale = 600 / (max(x for x, _ in corners) + 0.5 - left)

        def color(x: float, y: float, at: tuple[float, float, float] = (left, top, scale), seen=pixels) -> list[int]:  # type: ignore[no-untyped-def]
            return seen[int((at[1] - y) * at[2]), int((x - at[0]) * at[2])].tolist()  # type: ignore[no-any-return]

        rows, columns = np.nonzero(plan.occupied)
        for row, column in list(zip(rows.tolist(), columns.tolist(), strict=True))[::7]:
            u, v = 0.2 * (column + 0.5), 0.2 * (row + 0.5)
            x, y = -4 + cos * u - sin * v, -4 + sin * u + cos * v
            if math.dist((x, y), (1.0, -2.0)) > 1.0:
                assert color(x, y) == [0, 0, 255]
        assert color(0.8, -2.2) == [0, 255, 0]
        assert color(0.05, 0.05) != [0, 0, 255]


def test_an_svg_holds_the_same_things(tmp_path: Path) -> None:
    """It is well-formed, with the plan as an image, a polygon for each body, the ids and a scale."""
    path = tmp_path / "world.svg"
    robots, box = (GREEN, make_robot(2.0, 2.0)), make_box("b", -2.0, 0.0)
    draw_world(msgspec.structs.replace(make_maze(), obstacles=(box,), robots=robots), path)
    root = ET.fromstring(path.read_text())
    tags = [element.tag.rpartition("}")[2] for element in root]
    assert tags.count("image") == 1
    assert tags.count("polygon") == 1 + 2 * 2
    texts = [element.text for element in root.iter() if element.tag.endswith("text")]
    assert texts[:2] == ["0", "1"]
    assert re.fullmatch(r"[125]0* m", texts[2] or "")


def test_a_fan_reaches_its_hits(tmp_path: Path) -> None:
    """A fan is a polygon from the laser over all ends, with a dot at every hit and none at a miss."""
    path = tmp_path / "fan.svg"
    fan = Fan((0.0, 0.0), [(1.0, 0.0), (1.0, 1.0), (0.0, 1.0)], [True, False, True])
    draw_world(make_world(make_robot(), wall_at=2.0), path, fans={0: [fan]})
    text = path.read_text()
    assert text.count("<circle") == 2
    (points,) = re.findall(r'points="([^"]+)"[^>]*fill-opacity="0.18"', text)
    assert len(points.split()) == 4


@pytest.mark.parametrize(
    ("name", "width", "text"),
    [("x.pdf", 800, "svg or .png"), ("no/such/x.svg", 800, "cannot write"), ("x.png", 100_000, "pixels wide")],
)
def test_what_cannot_be_drawn_is_said(tmp_path: Path, name: str, width: int, text: str) -> None:
    """Another format, a folder that is not there and an absurd size are errors of one line."""
    with pytest.raises(UsageError, match=text):
        draw_world(make_world(make_robot()), tmp_path / name, width=width)
