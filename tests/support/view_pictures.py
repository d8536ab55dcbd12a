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
MOMENT = 68.0
"""Simulated seconds after which the world stands."""
LIMIT = 120_000
"""Milliseconds that a page may take on a busy machine."""
WIDE, PHONE = (1200, 720), (390, 780)
PLOTS = (
    "robot_0/odom:twist.twist.angular.z",
    "robot_1/odom:twist.twist.angular.z",
    "robot_0/odom:twist.twist.linear.x",
)
PICTURES = {
    "view": (WIDE, "side=team&selected=1&theme=light"),
    "view-plots": (WIDE, f"side=topics&echo=robot_1/odom&dock=plots&theme=dark&plots={','.join(PLOTS)}"),
    "view-phone": (PHONE, "side=team&theme=light"),
}
"""Size of the screen in pixels and the layout, by the file's name."""


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


def open_page(browser: "Browser", url: str, size: tuple[int, int], layout: str) -> Screen:
    """A page of this size in pixels, which follows robot_1."""
    context = browser.new_context(viewport={"width": size[0], "height": size[1]})
    screen = Screen(context.new_page())
    screen.page.set_default_timeout(LIMIT)
    screen.open(f"{url}&{layout}", 4)
    screen.ask("zteam.app.camera.set({follow: 1, scale: 38})")
    return screen


def main() -> None:
    """Make all pictures."""
    FOLDER.mkdir(exist_ok=True)
    team = TeamFixture()
    try:
        team.start("office", robots=4, follow={1: 0, 2: 1, 3: 2}, params={0: LEADER}, lockstep=False)
        team.wait_for_go()
        with chromium() as browser:
            url = start_view(team)
            pages = {name: open_page(browser, url, size, layout) for name, (size, layout) in PICTURES.items()}
            run_until_moment(team, pages["view-plots"])
            for name, screen in pages.items():
                save(screen, name)
    finally:
        team.close()


if __name__ == "__main__":
    main()
