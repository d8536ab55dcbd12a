"""A page of the view in headless chromium: where things are on its screen, and what it was told."""

import json
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import pytest

from zteam.clock import HOST_FACTOR, monotonic
from zteam.team.testing.team import TeamFixture

if TYPE_CHECKING:
    from playwright.sync_api import Browser, ConsoleMessage, Page

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
ARGUMENTS = ("--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
"""Without a sandbox, because containers run as root; WebGL2 in software."""
LIMIT = round(20_000 * HOST_FACTOR)
"""Milliseconds that a page may take for anything on a crowded machine."""
POLL = 20
"""Milliseconds between two looks at the page."""
VIEW = "view_test"

SETTLED = """([id, x, y]) => {
  const pose = zteam.app.store.poses.at(id);
  return pose !== null && Math.hypot(pose.x - x, pose.y - y) < 0.02;
}"""

SHOW = """([x, y]) => {
  const { camera, scene } = zteam.app, [px, py] = camera.toScreen(x, y);
  camera.placed = true;
  if (px < 0 || py < 0 || px > camera.width || py > camera.height) scene.fit();
}"""

PHONE: dict[str, Any] = {"viewport": {"width": 390, "height": 844}, "has_touch": True, "is_mobile": True}
TARGET = 44
"""Pixels that a finger needs."""
SMALL = """(least) => [...document.querySelectorAll('button, select, input, summary')].filter((one) => {
  const around = one.matches('[type=checkbox], [type=radio]') ? one.closest('label') : one;
  const {width, height} = around.getBoundingClientRect();
  const cut = one.matches('button') && one.scrollWidth > one.clientWidth;
  return width && (width < least || height < least || cut);
}).map((one) => one.outerHTML)"""
"""Controls that are smaller than that, or whose text does not fit."""


def start_view(team: TeamFixture, *arguments: str, port: int = 0) -> str:
    """Start a view of this team, at any free port unless told; the URL that it prints, with the token."""
    known = len(team.lines(VIEW))
    team.spawn("zteam-view", "--no-browser", "--port", str(port), "--name", VIEW, *arguments, name=VIEW)
    team.wait_for_processes(VIEW)
    said = "the view is at "

    def urls() -> list[str]:
        return [line.partition(said)[2].strip() for line in team.lines(VIEW)[known:] if said in line]

    team.wait_for(lambda: bool(urls()))
    return urls()[-1]


class Screen:
    """One page, driven by mouse and keys."""

    def __init__(self, page: "Page") -> None:
        self.page = page
        self.complaints: list[str] = []
        """Errors of the page's own code, and what its policy forbids."""
        page.set_default_timeout(LIMIT)
        page.on("pageerror", lambda error: self.complaints.append(str(error)))
        page.on("console", self._hear)

    def _hear(self, message: "ConsoleMessage") -> None:
        # A server that is away is part of some tests, and a server may have no layout.
        expected = "WebSocket" in message.text or message.location["url"].endswith("/layout.json")
        if message.type == "error" and not expected:
            self.complaints.append(message.text)

    def open(self, url: str, robots: int = 0, *, panels: bool = True) -> None:
        """Load the page, and wait until it is connected, shows that many robots and, unless told, has its panels."""
        self.page.goto(url)
        self.wait("window.zteam?.app.store.connection.state === 'open'")
        self.wait("n => zteam.app.store.poses.count >= n && zteam.app.store.robots.size >= n", robots)
        if panels:
            self.wait("document.querySelector('#panel [role=tab]') !== null")

    def ask(self, script: str, argument: Any = None) -> Any:
        """The value of some JavaScript."""
        return self.page.evaluate(script, argument)

    def wait(self, script: str, argument: Any = None) -> Any:
        """Wait until some JavaScript is true; its value.

        Playwright's own `wait_for_function` needs `eval`, which the page's policy forbids.
        """
        deadline = monotonic() + LIMIT / 1000
        while not (value := self.ask(script, argument)):
            assert monotonic() < deadline, f"not true within {LIMIT / 1000:g} s: {script}"
            self.page.wait_for_timeout(POLL)
        return value

    def pose(self, robot: int) -> Any:
        """Where the page has a robot by its transforms, which may be late when those of another robot have come."""
        return self.wait("id => [zteam.app.store.poses.at(id)].find((pose) => pose && !pose.truth)", robot)

    def place(self, x: float, y: float) -> tuple[float, float]:
        """Where a place of the map is on the page, in pixels; for one that is not shown it shows the whole map. From
        now on the map does not move by itself, as when robots come."""
        self.ask(SHOW, [x, y])
        box = self.page.locator("#scene").bounding_box()
        assert box is not None
        px, py = self.ask("([x, y]) => zteam.app.camera.toScreen(x, y)", [x, y])
        return box["x"] + px, box["y"] + py

    def wait_for_robot(self, robot: int, x: float, y: float) -> None:
        """Wait until the page shows the robot there (m)."""
        self.wait(SETTLED, [robot, x, y])

    def select(self, *robots: int) -> None:
        """Click robots, the later ones with shift."""
        self.tool("select")
        for i, robot in enumerate(robots):
            pose = self.pose(robot)
            if i:
                self.page.keyboard.down("Shift")
            self.page.mouse.click(*self.place(pose["x"], pose["y"]))
            self.page.keyboard.up("Shift")
        self.wait(
            "ids => JSON.stringify([...zteam.app.store.selection].sort()) === ids",
            json.dumps(sorted(robots)).replace(" ", ""),
        )

    def tool(self, name: str) -> None:
        """Choose a tool by its button."""
        self.page.click(f"#tools [data-tool={name}]")

    def confirm(self, label: str, question: str) -> None:
        """Click a button and then its question; anew where the four seconds of the question were over in between."""
        deadline = monotonic() + LIMIT / 1000
        button = self.page.locator(f"button:text-is('{label}'), button:text-is('{question}')").first
        while monotonic() < deadline:
            asked = button.inner_text() == question
            button.click()
            if asked and self.page.locator(f"button:text-is('{question}')").count() == 0:
                return
        raise AssertionError(f"{question!r} had no answer")

    def drag(self, start: tuple[float, float], end: tuple[float, float]) -> None:
        """Press at one place of the map, release at another one."""
        # Both are on the screen before the mouse is pressed.
        self.place(*end)
        self.page.mouse.move(*self.place(*start))
        self.page.mouse.down()
        self.page.mouse.move(*self.place(*end), steps=5)
        self.page.mouse.up()

    @property
    def pixel(self) -> float:
        """Metres of a pixel."""
        return float(1 / self.ask("zteam.app.camera.scale"))


def show(team: TeamFixture, screen: Screen, robots: int = 2, *, world: str = "arena", behavior: str = "idle") -> str:
    """Start a team in real time, and open a page that shows it with its map; the URL, with the token."""
    team.start(world, robots, behavior=behavior, lockstep=False)
    url = start_view(team)
    screen.open(url, robots)
    screen.wait("zteam.app.store.grids.has('map')")
    return url


def complaints(screen: Screen, *places: str, rules: list[str] | None = None) -> list[str]:
    """What axe-core finds wrong with the page now, or with these parts of it; by all its rules or by these alone."""
    axe = pytest.importorskip("axe_playwright_python.sync_playwright").Axe()
    options = {"resultTypes": ["violations"], **({"runOnly": rules} if rules else {})}
    context = {"include": [[place] for place in places]} if places else None
    found = axe.run(screen.page, context, options).response["violations"]
    return [f"{rule['id']}: {[node['html'] for node in rule['nodes']]}" for rule in found]


@contextmanager
def chromium() -> "Iterator[Browser]":
    """The machine's browser, without a window."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=list(ARGUMENTS))
        try:
            yield browser
        finally:
            browser.close()


OpenScreen = Callable[..., Screen]
"""Makes a page: keywords as `Browser.new_context` takes them."""
