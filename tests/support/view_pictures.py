"""Makes the pictures of docs/view.md and docs/navigation.md: a team, its view, and a browser that looks at it.

From the top of a checkout: PYTHONPATH=tests python -m support.view_pictures
"""

import io
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from PIL import Image

from support.browser import Screen, chromium, start_view
from zteam.team.testing.team import TeamFixture

if TYPE_CHECKING:
    from playwright.sync_api import Browser

FOLDER = Path(__file__).resolve().parents[2] / "docs" / "pictures"
COLORS = 128
MOST_BYTES = 150_000
LIMIT = 120_000
"""Milliseconds that a page may take on a busy machine."""
WIDE, PHONE = (1200, 720), (390, 780)
PLOTS = (
    "robot_0/odom:twist.twist.angular.z",
    "robot_1/odom:twist.twist.angular.z",
    "robot_0/odom:twist.twist.linear.x",
)
NAVIGATION = "map,robots,labels,scans,goals,plans,costmaps,particles"


class Scene(NamedTuple):
    """A team, and what is shown of it."""

    start: Callable[[TeamFixture], None]
    moment: float
    """Simulated seconds after which the world stands."""
    camera: dict[str, float]
    pictures: dict[str, tuple[tuple[int, int], str]]
    """Size of the screen in pixels and the layout, by the file's name."""


def start_line(team: TeamFixture) -> None:
    """Four robots in a line."""
    follow = {1: 0, 2: 1, 3: 2}
    team.start("office", robots=4, follow=follow, params={0: {"speed": 0.5}}, lockstep=False)


def start_navigation(team: TeamFixture) -> None:
    """Four robots on their ways to goals."""
    team.launch("navigation", lockstep=False)


SCENES = (
    Scene(
        start_line,
        68.0,
        {"follow": 1, "scale": 38},
        {
            "view": (WIDE, "side=team&selected=1&theme=light"),
            "view-plots": (WIDE, f"side=topics&echo=robot_1/odom&dock=plots&theme=dark&plots={','.join(PLOTS)}"),
            "view-phone": (PHONE, "side=team&theme=light"),
        },
    ),
    Scene(
        start_navigation,
        17.0,
        {"follow": 1, "scale": 24},
        {"navigation": (WIDE, f"side=team&selected=1&theme=light&layers={NAVIGATION}")},
    ),
)


def save(screen: Screen, name: str) -> None:
    """What the screen shows, as a small PNG."""
    picture = Image.open(io.BytesIO(screen.page.screenshot())).convert("RGB")
    path = FOLDER / f"{name}.png"
    picture.quantize(COLORS, dither=Image.Dither.NONE).save(path, optimize=True)
    size = path.stat().st_size
    assert size < MOST_BYTES, f"{path.name} has {size} bytes"
    print(f"{path.relative_to(FOLDER.parents[1])}: {size} bytes")  # noqa: T201


def run_until(team: TeamFixture, screen: Screen, moment: float) -> None:
    """Let the world go on while the page looks, then let it stand."""
    team.sim.set_speed(3.0)
    screen.wait("moment => zteam.app.store.frame.stamp > moment", moment)
    team.sim.pause()
    screen.wait("zteam.app.store.team.sim.state === 'paused'")


def open_page(browser: "Browser", url: str, size: tuple[int, int], layout: str, camera: dict[str, float]) -> Screen:
    """A page of this size in pixels, with this layout and camera."""
    context = browser.new_context(viewport={"width": size[0], "height": size[1]})
    screen = Screen(context.new_page())
    screen.page.set_default_timeout(LIMIT)
    screen.open(f"{url}&{layout}", 4)
    screen.ask("camera => zteam.app.camera.set(camera)", camera)
    return screen


def show(browser: "Browser", scene: Scene) -> None:
    """Make the pictures of one scene."""
    team = TeamFixture()
    try:
        scene.start(team)
        team.wait_for_go()
        url = start_view(team)
        pages = {
            name: open_page(browser, url, size, layout, scene.camera) for name, (size, layout) in scene.pictures.items()
        }
        run_until(team, next(reversed(pages.values())), scene.moment)
        for name, screen in pages.items():
            save(screen, name)
    finally:
        team.close()


def main() -> None:
    """Make all pictures."""
    FOLDER.mkdir(exist_ok=True)
    with chromium() as browser:
        for scene in SCENES:
            show(browser, scene)


if __name__ == "__main__":
    main()
