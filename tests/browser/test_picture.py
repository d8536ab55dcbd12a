"""What is drawn: held against `zteam world show` of the same world."""

import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from support.browser import OpenScreen, Screen, show, start_view
from zteam.team.testing.team import TeamFixture

HALF = 5.0
"""The arena's walls reach from -5 to 5 m in x and y."""
STEP = 0.05
"""Metres between the samples that are compared."""
ONLY = """(shown) => {
  for (const name of [...zteam.app.layers.shown]) zteam.app.layers.set(name, shown.includes(name));
}"""

Mask = NDArray[np.bool_]


def brightness(picture: Image.Image) -> NDArray[np.int_]:
    """The darkest channel of each pixel: ground is white, all else is not."""
    return np.asarray(picture.convert("RGB")).astype(int).min(axis=2)


def sample(covered: Mask, columns: NDArray[np.float64], rows: NDArray[np.float64]) -> Mask:
    """Whether something stands at each place (rows from the top of the map down)."""
    return covered[np.ix_(np.rint(rows).astype(int), np.rint(columns).astype(int))]


def is_even(samples: Mask) -> Mask:
    """Where all samples around one are as itself: places beside an edge may be rounded either way."""
    same = np.ones_like(samples)
    for down in (-1, 0, 1):
        for right in (-1, 0, 1):
            same &= np.roll(samples, (down, right), (0, 1)) == samples
    return same


def shown_by_command(team: TeamFixture, folder: Path, places: NDArray[np.float64]) -> Mask:
    """What `zteam world show` draws at these places; the arena's outer walls tell where its picture lies."""
    file = folder / "arena.png"
    assert team.command("world", "show", "arena", "-o", str(file), "--width", "1600").returncode == 0
    covered = brightness(Image.open(file)) < 200
    # Below the map is the scale bar.
    walls = covered.sum(axis=1) > 0.5 * covered.shape[1]
    rows, columns = np.flatnonzero(walls), np.flatnonzero(covered[np.flatnonzero(walls)[0]])
    scale = (columns[-1] + 1 - columns[0]) / (2 * HALF)
    return sample(covered, columns[0] + (places + HALF) * scale, rows[0] + (HALF - places[::-1]) * scale)


def shown_by_page(screen: Screen, places: NDArray[np.float64]) -> Mask:
    """What the page draws at these places."""
    covered = brightness(Image.open(io.BytesIO(screen.page.screenshot()))) < 200
    corners: Any = [screen.place(x, y) for x, y in ((0, 0), (1, 1))]
    (x0, y0), (x1, y1) = corners
    return sample(covered, x0 + places * (x1 - x0), y0 + places[::-1] * (y1 - y0))


def test_the_page_draws_what_world_show_draws(team: TeamFixture, open_screen: OpenScreen, tmp_path: Path) -> None:
    """Walls, crates and robots stand at the same places; all samples away from edges agree."""
    team.start("arena", 2, behavior="idle", lockstep=False)
    screen = open_screen(color_scheme="light")
    screen.open(start_view(team), 2)
    screen.wait("zteam.app.store.grids.size === 1")
    screen.ask(ONLY, ["map", "robots"])
    # Without panels, so that the map is large.
    screen.page.keyboard.press("0")
    screen.page.keyboard.press("Home")
    frames = screen.ask("zteam.stats.frames")
    screen.wait("n => zteam.stats.frames > n + 2", frames)
    places = np.arange(-HALF + 0.025, HALF, STEP)
    expected, found = shown_by_command(team, tmp_path, places), shown_by_page(screen, places)
    certain = is_even(expected) & is_even(found)
    # The scale bar and what the tools show are above the map.
    assert certain.mean() > 0.85
    assert (expected & certain).sum() > 500, "crates, pillar and robots"
    assert not (expected != found)[certain].any()
    for x in (-1.5, -3.5):
        robot = abs(places[None, :] - x) + abs(places[::-1, None]) < 0.1
        assert found[robot].all(), "a robot stands there"


def test_a_picture_has_both_canvases(team: TeamFixture, screen: Screen) -> None:
    """The picture that a key saves is as large as the map area, with the map's walls and the names above it."""
    show(team, screen, 1)
    with screen.page.expect_download() as download:
        screen.page.keyboard.press("Shift+P")
    assert download.value.suggested_filename.endswith(".png")
    picture = Image.open(download.value.path())
    assert picture.format == "PNG"
    box = screen.page.locator("#scene").bounding_box()
    assert box is not None
    assert picture.size == pytest.approx((box["width"], box["height"]), abs=1)
    dark = brightness(picture) < 100
    assert dark.sum() > 2000, "walls"
    assert dark[-40:, :160].sum() > 50, "the scale bar, on the upper canvas"
