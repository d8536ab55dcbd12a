"""Makes the pictures of docs/view.md: a team, its view, and a browser that looks at it.

From the top of a checkout: PYTHONPATH=tests python -m support.view_pictures
"""

import io
from pathlib import Path
from typing import TYPE_CHECKING

from PIL import Image

from support.browser import Screen, chromium, start_view
from zteam.testing.team import TeamFixture

if TYPE_CHECKING:
    from playwright.sync_api import Browser

FOLDER = Path(__file__).resolve().parents[2] / "docs" / "pictures"
COLORS = 128
MOST_BYTES = 150_000
LEADER = {"speed": 0.5}
MOMENT = 100.0
"""Simulated seconds after which the world stands: the line turns into a corridor."""


def save(screen: Screen, name: str) -> None:
    """What the screen shows, as a small PNG."""
    picture = Image.open(io.BytesIO(screen.page.screenshot())).convert("RGB")
    path = FOLDER / f"{name}.png"
    picture.quantize(COLORS, dither=Image.Dither.NONE).save(path, optimize=True)
    size = path.stat().st_size
    assert size < MOST_BYTES, f"{path.name} has {size} bytes"
    print(f"{path.relative_to(FOLDER.parents[1])}: {size} bytes")  # noqa: T201


def run_until_moment(team: TeamFixture, screen: Screen) -> None:
    """Let the world go on while the page looks, then let it stand."""
    team.sim.set_speed(3.0)
    screen.wait("moment => zteam.app.store.frame.stamp > moment", MOMENT)
    team.sim.pause()
    screen.wait("zteam.app.store.team.sim.state === 'paused'")


def open_pages(browser: "Browser", team: TeamFixture) -> tuple[Screen, Screen, Screen]:
    """The map with the table, plots on dark ground, and a phone."""
    url = start_view(team)
    pages = []
    for size, scheme, layout in (
        ((1200, 720), "light", "side=team&selected=1"),
        ((1200, 720), "dark", "side=topics&echo=robot_1/odom&dock=plots&span=30&plots="
         "robot_0/odom:twist.twist.angular.z,robot_1/odom:twist.twist.angular.z,robot_0/odom:twist.twist.linear.x"),
        ((390, 780), "light", "side=team"),
    ):  # fmt: skip
        context = browser.new_context(
            viewport={"width": size[0], "height": size[1]}, color_scheme="dark" if scheme == "dark" else "light"
        )
        screen = Screen(context.new_page())
        screen.page.set_default_timeout(60_000)
        screen.open(f"{url}&{layout}", 4)
        screen.ask("zteam.app.camera.set({follow: 1, scale: 38})")
        pages.append(screen)
    return pages[0], pages[1], pages[2]


def main() -> None:
    """Make all pictures."""
    FOLDER.mkdir(exist_ok=True)
    team = TeamFixture()
    try:
        team.start("office", robots=4, follow={1: 0, 2: 1, 3: 2}, params={0: LEADER}, lockstep=False)
        team.wait_for_go()
        with chromium() as browser:
            table, plots, phone = open_pages(browser, team)
            run_until_moment(team, plots)
            save(table, "view")
            save(plots, "view-plots")
            save(phone, "view-phone")
    finally:
        team.close()


if __name__ == "__main__":
    main()
