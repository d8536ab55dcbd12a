"""The page in a real browser, with software rendering: how long its JavaScript takes a frame.

It needs the package playwright and a chromium of the system; both are for developers only.
"""

import os
import shutil
import statistics
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from typing import Any, NamedTuple

import msgspec
import numpy as np

from studies.launching import launch
from zteam.clock import monotonic
from zteam.errors import ZteamError

WARM_UP, ENOUGH = 30, 50
"""Frames that are drawn before the page is measured, and that it draws at least meanwhile."""
LIMIT_MS = 90_000
VIEWPORT = {"width": 1280, "height": 800}
BROWSERS = ("chromium", "chromium-browser", "google-chrome")
_DRAWN = "() => window.zteam && zteam.stats && zteam.stats.age_ms.length > 0"
"""Whether a robot's pose was drawn."""
_TIMES = ("js_ms", "arrival_ms", "age_ms")
_READ = "() => zteam.stats"
_CLEAR = "times => { for (const name of times) zteam.stats[name].length = 0; return zteam.stats.frames }"


class Spread(NamedTuple):
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


class StartFigures(msgspec.Struct):
    """Seconds from `zteam up --view` to a drawn robot, medians of some starts."""

    said: float
    """Until the address is printed."""
    open_browser: float
    """In a new tab of a browser that is open and has seen the page before."""
    new_window: float
    """In a new window of it, which takes Chromium 0.6 s of a processor for its own controls."""
    new_user: float
    """The same, where the browser has never seen the page."""
    new_browser: float
    """With the start of the browser, which begins when the address is printed."""


def measure_start(runs: int) -> StartFigures:
    """Start the shipped team `line` so many times for each figure. Raises ZteamError without a browser."""
    said: list[float] = []

    def start(open_page: Callable[[], Any]) -> float:
        """Seconds until a robot is drawn; those until the address is printed are added to `said`."""
        with launch() as processes:
            begin = monotonic()
            environment = {"ZTEAM_NAMESPACE": f"bench_start_{os.getpid()}"}
            processes.start("up", "zteam", "up", "line", "--view", "--no-browser", environment=environment)
            url = processes.wait_for("up", r"http://\S+#token=\S+")[0]
            said.append(monotonic() - begin)
            page = open_page()
            page.goto(url, wait_until="commit")
            page.wait_for_function(_DRAWN, timeout=LIMIT_MS)
            drawn = monotonic() - begin
            page.close()
            return drawn

    def start_with_browser() -> float:
        with ExitStack() as stack:
            return start(lambda: stack.enter_context(launch_browser()).new_page(viewport=VIEWPORT))

    with launch_browser() as browser:
        user, other = (browser.new_context(viewport=VIEWPORT) for _ in range(2))
        # A page that stays keeps a window open.
        user.new_page()
        # Twice first: the graphics of a browser start with the first page, and its cache is empty.
        for _ in range(2):
            start(user.new_page)
            start(other.new_page)
        open_browser = [start(user.new_page) for _ in range(runs)]
        new_window = [start(other.new_page) for _ in range(runs)]
        new_user = [start(lambda: browser.new_page(viewport=VIEWPORT)) for _ in range(runs)]
    new_browser = [start_with_browser() for _ in range(runs)]
    return StartFigures(*map(statistics.median, (said, open_browser, new_window, new_user, new_browser)))
