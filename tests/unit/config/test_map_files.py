"""Maps of map_server: what each pixel means, to the simulator and to navigation."""

from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from zteam.navigation.planning.maps import read_map
from zteam.world import load_world

GREYS = (0, 49, 50, 88, 89, 90, 127, 128, 190, 191, 192, 205, 206, 254, 255)
PAIRS = [(grey, alpha) for grey in GREYS for alpha in (0, 100, 200, 255)]
COLORS = [(grey, 255 - grey, 40, alpha) for grey, alpha in PAIRS]
Pixels = list[tuple[float, float, float, float | None]]
"""Red, green and blue, 0 to 255, and alpha, None in a picture that has none."""


def picture(kind: str, folder: Path) -> tuple[str, Pixels]:
    """The name of a picture of one row, written into `folder`, and its pixels."""
    name = f"{kind}.{kind if kind in ('pgm', 'bmp') else 'png'}"
    found: Pixels = [(grey, grey, grey, None) for grey in GREYS]
    array: Any = np.array(GREYS, np.uint8)[None]
    if kind == "grey and alpha":
        array, found = np.array(PAIRS, np.uint8)[None], [(g, g, g, a) for g, a in PAIRS]
    elif kind in ("rgb", "rgba"):
        array = np.array(COLORS, np.uint8)[None, :, : len(kind)]
        found = [(r, g, b, a if kind == "rgba" else None) for r, g, b, a in COLORS]
    elif kind == "16 bits":
        deep = [64 * 257 + 200, 0x7FFF, 0x8000, 65535, 89 * 257 + 100]
        array, found = np.array([deep], np.uint16), [(v / 257, v / 257, v / 257, None) for v in deep]
    image, extra = Image.fromarray(array), {}
    if kind == "palette":
        image = image.convert("P")
    elif kind == "a transparent shade":
        extra, found = {"transparency": 88}, [(g, g, g, 0 if g == 88 else 255) for g in GREYS]
    elif kind == "a transparent entry":
        image, extra = image.convert("P"), {"transparency": 88}
        found = [(g, g, g, 0 if index == 88 else 255) for g, index in zip(GREYS, np.asarray(image)[0], strict=True)]
    image.save(folder / name, **extra)
    return name, found


def map_servers(
    pixel: tuple[float, float, float, float | None], mode: str, negate: bool, low: float, high: float
) -> int:
    """The cell of a pixel as nav2_map_server's map_io.cpp describes it, one at a time."""
    *channels, alpha = pixel
    if mode == "trinary" and alpha is not None:
        channels.append(alpha)
    shade = sum(channels) / len(channels) / 255
    if mode == "raw":
        return round(shade * 255) if round(shade * 255) <= 100 else -1
    occupancy = shade if negate else 1 - shade
    if mode == "scale" and alpha not in (None, 255):
        return -1
    if occupancy > high or occupancy < low:
        return 100 if occupancy > high else 0
    return -1 if mode == "trinary" else round((occupancy - low) / (high - low) * 100)


KINDS = ("pgm", "bmp", "grey", "grey and alpha", "rgb", "rgba", "16 bits", "palette")


@pytest.mark.parametrize("kind", [*KINDS, "a transparent shade", "a transparent entry"])
def test_simulator_and_navigation_read_the_cells_of_map_server(tmp_path: Path, kind: str) -> None:
    """In each mode, as Nav2 writes its name in any case, negated or not, with several thresholds: the same cells for
    both, and walls of the simulated world where they are occupied."""
    name, pixels = picture(kind, tmp_path)
    path = tmp_path / "m.yaml"
    modes, thresholds = ("Trinary", "SCALE", "raw"), ((0.25, 0.65), (0.196, 0.65), (0.0, 1.0), (0.5, 0.51))
    for mode, negate, (low, high) in product(modes, (0, 1), thresholds):
        path.write_text(
            f"image: {name}\nresolution: 0.1\norigin: [0, 0, 0]\nmode: {mode}\nnegate: {negate}\n"
            f"free_thresh: {low}\noccupied_thresh: {high}\n"
        )
        cells = np.array([[map_servers(pixel, mode.lower(), bool(negate), low, high) for pixel in pixels]])
        assert read_map(path).cells.tolist() == cells.tolist()
        (plan,) = load_world(path).floorplans
        # A raw picture has percents and no thresholds of its own.
        walls = cells > 100 * high if mode == "raw" else cells == 100
        assert plan.occupied.tolist() == walls.tolist()
