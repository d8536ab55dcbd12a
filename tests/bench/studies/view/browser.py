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
_TIMES = ("js_ms", "arrival_ms", "age_ms")
_READ = "() => zteam.stats"
_CLEAR = "times => { for (const name of times) zteam.stats[name].length = 0; return zteam.stats.frames }"


class Spread(msgspec.Struct):
    """Of many values."""

    p50: float
    p95: float


class DrawFigures(msgspec.Struct):
    """One browser at a view of so many robots; times in ms."""

    robots: int
    beams: int
    frames_per_s: float
    """That were drawn."""
    js_ms: Spread
    """As the page counts it, with what the browser's other threads take from a crowded machine meanwhile."""
    script_ms: float
    """Processor time of all its JavaScript a picture, as the browser counts it."""
    arrival_ms: Spread
    """Age of the newest poses when they came."""
    age_ms: Spread
    """The same when they were drawn."""


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
        browser_counts = page.context.new_cdp_session(page)
        browser_counts.send("Performance.enable", {"timeDomain": "threadTicks"})
        page.goto(url)
        found = _count(page, browser_counts, seconds)
    if not found["age_ms"]:
        raise ZteamError("the page has drawn no new poses")
    spreads = {name: Spread(*np.percentile(found[name], (50, 95))) for name in _TIMES}
    script_ms = 1e3 * found["scripts"] / found["frames"]
    return DrawFigures(robots, beams, found["frames"] / found["seconds"], script_ms=script_ms, **spreads)


def _scripts(browser_counts: Any) -> float:
    """Seconds that the page's JavaScript has taken so far."""
    metrics = browser_counts.send("Performance.getMetrics")["metrics"]
    return next(float(each["value"]) for each in metrics if each["name"] == "ScriptDuration")


def _count(page: Any, browser_counts: Any, seconds: float) -> dict[str, Any]:
    """What the page counts in `seconds` and ENOUGH frames, after a while in which it loads and its code is compiled."""
    page.wait_for_function(f"() => window.zteam && zteam.stats && zteam.stats.frames > {WARM_UP}", timeout=LIMIT_MS)
    before, scripts, begin = page.evaluate(_CLEAR, _TIMES), _scripts(browser_counts), monotonic()
    page.wait_for_timeout(1e3 * seconds)
    page.wait_for_function(f"() => zteam.stats.frames > {before + ENOUGH}", timeout=LIMIT_MS)
    found: dict[str, Any] = page.evaluate(_READ)
    counts = {"frames": found["frames"] - before, "seconds": monotonic() - begin}
    return {**found, **counts, "scripts": _scripts(browser_counts) - scripts}
