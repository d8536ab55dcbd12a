"""From `zteam up --view` to a drawn robot, as a user sees it: with a browser that is open, and with one that is not."""

import os
import re
import statistics
from contextlib import closing
from typing import Any

import msgspec

from studies.view.browser import LIMIT_MS, VIEWPORT, launch_browser
from zteam.clock import HOST_FACTOR, monotonic
from zteam.errors import ZteamError
from zteam.team.launch.process import zteam_command
from zteam.team.launch.supervisor import Supervisor

START_LIMIT = 30.0 * HOST_FACTOR
"""Host seconds for the view to say where it is."""
_DRAWN = "() => window.zteam && zteam.stats && zteam.stats.age_ms.length > 0"
"""Whether a robot's pose was drawn."""


class StartFigures(msgspec.Struct):
    """Seconds from the command to a drawn robot, medians of some starts."""

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
    with launch_browser() as browser:
        user, other = (browser.new_context(viewport=VIEWPORT) for _ in range(2))
        # A page that stays keeps a window open.
        user.new_page()
        # Twice first: the graphics of a browser start with the first page, and its cache is empty.
        for _ in range(2):
            _start(said, user.new_page)
            _start(said, other.new_page)
        open_browser = [_start(said, user.new_page) for _ in range(runs)]
        new_window = [_start(said, other.new_page) for _ in range(runs)]
        new_user = [_start(said, lambda: browser.new_page(viewport=VIEWPORT)) for _ in range(runs)]
    new_browser = [_start_with_browser(said) for _ in range(runs)]
    return StartFigures(*map(statistics.median, (said, open_browser, new_window, new_user, new_browser)))


def _start_with_browser(said: list[float]) -> float:
    browsers: list[Any] = []

    def open_page() -> Any:
        browsers.append(launch_browser())
        return browsers[0].__enter__().new_page(viewport=VIEWPORT)

    try:
        return _start(said, open_page)
    finally:
        for browser in browsers:
            browser.__exit__(None, None, None)


def _start(said: list[float], open_page: Any) -> float:
    """Seconds until a robot is drawn; those until the address is printed are added to `said`."""
    with closing(Supervisor(lambda _name, _line: None, lambda _process, _again: None)) as supervisor:
        begin = monotonic()
        command = zteam_command("zteam", "up", "line", "--view", "--no-browser")
        up = supervisor.start("up", command, {"ZTEAM_NAMESPACE": f"bench_start_{os.getpid()}"})

        def url() -> str:
            found = (re.search(r"http://\S+#token=\S+", line) for line in list(up.lines))
            return next((match[0] for match in found if match), "")

        supervisor.wait(lambda: bool(url()) or not up.running, START_LIMIT)
        if not url():
            raise ZteamError(f"the team did not start: {list(up.lines)[-1:]}")
        said.append(monotonic() - begin)
        page = open_page()
        page.goto(url(), wait_until="commit")
        page.wait_for_function(_DRAWN, timeout=LIMIT_MS)
        drawn = monotonic() - begin
        page.close()
        supervisor.stop(["up"])
        return drawn
