"""The colours of robots are told apart, and seen on the floor and on walls."""

import itertools
import re
from importlib.resources import files

import numpy as np
import pytest
from numpy.typing import NDArray

Array = NDArray[np.float64]
PAGE = files("zteam.view") / "page"
VISIONS = {
    "all": np.eye(3),
    # Machado, Oliveira and Fernandes (2009), severity 1, for linear RGB.
    "protanopia": np.array(
        [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]]
    ),
    "deuteranopia": np.array(
        [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]]
    ),
}
XYZ = np.array([[0.41246, 0.35758, 0.18044], [0.21267, 0.71515, 0.07217], [0.01933, 0.11919, 0.95030]])
"""Of linear RGB (IEC 61966-2-1)."""


def linear_of(text: str) -> Array:
    """Linear RGB of `#rrggbb`."""
    part = np.array([int(text[i : i + 2], 16) for i in (1, 3, 5)]) / 255
    return np.where(part <= 0.04045, part / 12.92, ((part + 0.055) / 1.055) ** 2.4)


def lab_of(linear: Array) -> Array:
    """CIELAB under D65."""
    share = XYZ @ np.clip(linear, 0.0, 1.0) / XYZ.sum(1)
    x, y, z = np.where(share > 216 / 24389, np.cbrt(share), (24389 / 27 * share + 16) / 116)
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


def difference(one: Array, other: Array) -> float:
    """CIEDE2000 of two colours in CIELAB (Sharma, Wu and Dalal 2005)."""
    (l1, a1, b1), (l2, a2, b2) = one, other
    chroma = (np.hypot(a1, b1) + np.hypot(a2, b2)) / 2
    grow = 1.5 - 0.5 * np.sqrt(chroma**7 / (chroma**7 + 25.0**7))
    c1, c2 = np.hypot(grow * a1, b1), np.hypot(grow * a2, b2)
    h1, h2 = np.arctan2(b1, grow * a1) % (2 * np.pi), np.arctan2(b2, grow * a2) % (2 * np.pi)
    turn = (h2 - h1 + np.pi) % (2 * np.pi) - np.pi
    light, c, h = (l1 + l2) / 2, (c1 + c2) / 2, h1 + turn / 2
    waves = ((1, -30, -0.17), (2, 0, 0.24), (3, 6, 0.32), (4, -63, -0.20))
    t = 1 + sum(share * np.cos(n * h + np.radians(degrees)) for n, degrees, share in waves)
    dl = (l2 - l1) / (1 + 0.015 * (light - 50) ** 2 / np.sqrt(20 + (light - 50) ** 2))
    dc = (c2 - c1) / (1 + 0.045 * c)
    dh = 2 * np.sqrt(c1 * c2) * np.sin(turn / 2) / (1 + 0.015 * c * t)
    off = (np.degrees(h) % 360 - 275) / 25
    bend = -2 * np.sqrt(c**7 / (c**7 + 25.0**7)) * np.sin(np.radians(60) * np.exp(-(off**2)))
    return float(np.sqrt(dl**2 + dc**2 + dh**2 + bend * dc * dh))


def contrast(one: str, other: str) -> float:
    """Of two colours, as WCAG 2 defines it."""
    dark, light = sorted(float(XYZ[1] @ linear_of(text)) for text in (one, other))
    return (light + 0.05) / (dark + 0.05)


def palette(name: str) -> list[str]:
    """The page's base colours."""
    text = (PAGE / "js" / "robot_colors.js").read_text("utf-8")
    return re.findall(r"#\w{6}", next(line for line in text.splitlines() if line.startswith(f"const {name} ")))


def ground(name: str) -> list[str]:
    """What the page paints a part of the map with, in the light and in the dark theme."""
    return re.findall(rf"--map-{name}: (#\w+);", (PAGE / "scene.css").read_text("utf-8"))


def test_the_difference_is_that_of_the_paper() -> None:
    """Pairs 1, 7 and 17 of the table of Sharma, Wu and Dalal (2005)."""
    pairs = [
        ((50.0, 2.6772, -79.7751), (50.0, 0.0, -82.7485), 2.0425),
        ((50.0, 0.0, 0.0), (50.0, -1.0, 2.0), 2.3669),
        ((50.0, 2.5, 0.0), (73.0, 25.0, -18.0), 27.1492),
    ]
    found = [difference(np.array(a), np.array(b)) for a, b, _ in pairs]
    assert found == pytest.approx([paper for *_, paper in pairs], abs=1e-4)


@pytest.mark.parametrize(("name", "theme"), [("ON_LIGHT", 0), ("ON_DARK", 1)])
def test_the_first_robots_are_told_apart(name: str, theme: int) -> None:
    """By each vision, and each from the floor and from the wall on which its laser points lie."""
    colors = palette(name)
    assert len(colors) == 8
    for vision, matrix in VISIONS.items():
        wall, *seen = [lab_of(matrix @ linear_of(color)) for color in (ground("occupied")[theme], *colors)]
        assert min(difference(color, wall) for color in seen) >= 8.0, vision
        least = min((difference(a, b), i, j) for (i, a), (j, b) in itertools.combinations(enumerate(seen), 2))
        assert least[0] >= 10.0, (vision, least)
    assert min(contrast(color, ground("free")[theme]) for color in colors) >= 3.0
    # In the light theme walls are dark. In the dark one they are grey: there colours differ by hue.
    assert theme == 1 or min(contrast(color, ground("occupied")[theme]) for color in colors) >= 2.0
