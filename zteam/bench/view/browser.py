"""The page in a real browser, with software rendering: how long its JavaScript takes a frame.

It needs the package playwright and a chromium of the system; both are for developers only.
"""

import os
import shutil
from typing import Any

import msgspec

from zteam.errors import ZteamError

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


def measure_drawing(url: str, robots: int, beams: int, seconds: float) -> DrawFigures:
    """Open the page, let it settle, and read what it counts for `seconds`. Raises ZteamError without a browser."""
    import numpy as np

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
            page = browser.new_page(viewport={"width": 1280, "height": 800})
            page.goto(url)
            found = _count(page, seconds)
        finally:
            browser.close()
    js, age = np.array(found["js"]), np.array(found["age"])
    if js.size < 10 or age.size < 10:
        raise ZteamError(f"the page drew {js.size} frames in {seconds:g} s")
    return DrawFigures(
        robots=robots,
        beams=beams,
        frames_per_s=found["frames"] / seconds,
        js_p50=float(np.percentile(js, 50)),
        js_p95=float(np.percentile(js, 95)),
        age_p50=float(np.percentile(age, 50)),
        age_p95=float(np.percentile(age, 95)),
    )


def _count(page: Any, seconds: float) -> dict[str, Any]:
    """What the page counts in `seconds`, after a while in which it loads and its code is compiled."""
    page.wait_for_function("() => window.zteam && zteam.stats && zteam.stats.frames > 30", timeout=60_000)
    before = page.evaluate(_CLEAR)
    page.wait_for_timeout(1e3 * seconds)
    found: dict[str, Any] = page.evaluate(_READ)
    found["frames"] -= before
    return found
