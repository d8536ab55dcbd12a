"""Pages in headless chromium; skipped where playwright or chromium is missing."""

import importlib.util
from collections.abc import Iterator
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from support.browser import CHROMIUM, OpenScreen, Screen, chromium

if TYPE_CHECKING:
    from playwright.sync_api import Browser

HERE = Path(__file__).parent
ORIGIN = "http://page.test"


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark what is in this folder, and skip it where there is no browser."""
    lacking = [
        *([] if importlib.util.find_spec("playwright") else ["pip install playwright"]),
        *([] if CHROMIUM else ["apt-get install chromium"]),
    ]
    for item in items:
        if HERE in item.path.parents:
            item.add_marker("browser")
            if lacking:
                item.add_marker(pytest.mark.skip(reason=f"no browser for tests: {', '.join(lacking)}"))


@pytest.fixture(scope="session")
def browser() -> "Iterator[Browser]":
    """The machine's chromium."""
    with chromium() as started:
        yield started


@pytest.fixture
def open_screen(browser: "Browser") -> Iterator[OpenScreen]:
    """Makes pages; they are closed with the test, which fails if their code made an error."""
    screens: list[Screen] = []

    def make(**options: Any) -> Screen:
        context = browser.new_context(**{"viewport": {"width": 1280, "height": 800}, **options})
        screens.append(Screen(context.new_page()))
        return screens[-1]

    yield make
    for screen in screens:
        screen.page.context.close()
    assert not [complaint for screen in screens for complaint in screen.complaints]


@pytest.fixture
def screen(open_screen: OpenScreen) -> Screen:
    """One page of 1280 x 800."""
    return open_screen()


@pytest.fixture
def modules(screen: Screen) -> Iterator[Screen]:
    """An empty page of an origin that serves the page's modules, without a server."""
    page = files("zteam.view") / "page"

    def answer(route: Any) -> None:
        name = route.request.url.removeprefix(ORIGIN).removeprefix("/page/")
        if name.endswith(".js"):
            route.fulfill(body=(page / name).read_text("utf-8"), content_type="text/javascript")
        else:
            route.fulfill(body="<!doctype html><title>modules</title>", content_type="text/html")

    screen.page.route("**/*", answer)
    screen.page.goto(ORIGIN)
    yield screen
    # A script that still runs must not outlive the routes.
    screen.page.unroute_all(behavior="wait")
