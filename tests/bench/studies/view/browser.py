"""The page in a real browser, with software rendering: how long its JavaScript takes a frame.

It needs the package playwright and a chromium of the system; both are for developers only.
"""

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import msgspec

from zteam.clock import monotonic
from zteam.errors import ZteamError

WARM_UP, ENOUGH = 30, 50
"""Frames that are drawn before the page is measured, and that it draws at least meanwhile."""
LIMIT_MS = 90_000
VIEWPORT = {"width": 1280, "height": 800}
BROWSERS = ("chromium", "chromium-browser", "google-chrome")
_READ = "() => ({frames: zteam.stats.frames, js: Array.from(zteam.stats.js_ms), age: Array.from(zteam.stats.age_ms)})"
_CLEAR = "() => { zteam.stats.js_ms.length = 0; zteam.stats.age_ms.length = 0; return zteam.stats.frames }"


class DrawFigures(msgspec.Struct):
    """One browser at a view of so many robots; times in ms."""

    robots: int
    beams: int
    frames_per_s: float
    """That were drawn."""
    js_p50: float
    js_p95: float
    age_p50: float
    """Of the newest poses when they were drawn."""
    age_p95: float


@contextmanager
def launch_browser() -> Iterator[Any]:
    """A browser without a window. Raises ZteamError where there is none."""
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        raise ZteamError("the package playwright is not installed: pip install playwright") from None
    program = next(filter(None, map(shutil.which, BROWSERS)), None)
    if program is None:
        raise ZteamError("there is no chromium: apt-get install chromium")
    with sync_playwright() as playwright:
        flags = ["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
        flags += ["--no-sandbox"] if os.getuid() == 0 else []
        browser = playwright.chromium.launch(executable_path=program, args=flags)
        try:
            yield browser
        finally:
            browser.close()


def measure_drawing(url: str, robots: int, beams: int, seconds: float) -> DrawFigures:
    """Open the page, let it settle, and read what it counts for `seconds`. Raises ZteamError without a browser."""
    import numpy as np

    with launch_browser() as browser:
        page = browser.new_page(viewport=VIEWPORT)
        page.goto(url)
        found = _count(page, seconds)
    js, age = np.array(found["js"]), np.array(found["age"])
    if not js.size or not age.size:
        raise ZteamError("the page has drawn no new poses")
    return DrawFigures(
        robots=robots,
        beams=beams,
        frames_per_s=found["frames"] / found["seconds"],
        js_p50=float(np.percentile(js, 50)),
        js_p95=float(np.percentile(js, 95)),
        age_p50=float(np.percentile(age, 50)),
        age_p95=float(np.percentile(age, 95)),
    )


def _count(page: Any, seconds: float) -> dict[str, Any]:
    """What the page counts in `seconds` and ENOUGH frames, after a while in which it loads and its code is compiled."""
    page.wait_for_function(f"() => window.zteam && zteam.stats && zteam.stats.frames > {WARM_UP}", timeout=LIMIT_MS)
    before, begin = page.evaluate(_CLEAR), monotonic()
    page.wait_for_timeout(1e3 * seconds)
    page.wait_for_function(f"() => zteam.stats.frames > {before + ENOUGH}", timeout=LIMIT_MS)
    found: dict[str, Any] = page.evaluate(_READ)
    return {**found, "frames": found["frames"] - before, "seconds": monotonic() - begin}
