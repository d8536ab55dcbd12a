"""Makes the pictures of README.md, docs/view.md and docs/navigation.md: a team, its view, a browser that looks at it.

From the top of a checkout: PYTHONPATH=tests python -m support.view_pictures [NAME …]
"""

import io
import sys
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
FILM, FILM_SCREEN, FILM_SIZE = "team", (860, 600), (800, 440)
"""Its name; sizes in pixels of the page and of the part that is shown."""
FILM_START, FILM_PICTURES, FILM_STEP = 60.0, 80, 0.1
"""Simulated seconds before it, how many pictures it has, and the seconds from one to the next."""
FILM_SPEED = 0.05
"""Of the world meanwhile: a picture takes its time."""
FILM_READY = "moment => zteam.app.store.frame.stamp >= moment && zteam.app.store.poses.left < 0.5"
MOST_FILM_BYTES = 1_500_000
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
    report(path, MOST_BYTES)


def report(path: Path, most: int) -> None:
    """Print a picture's size, which must not be more than `most` bytes."""
    size = path.stat().st_size
    assert size < most, f"{path.name} has {size} bytes"
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


def film(browser: "Browser") -> None:
    """Make the moving picture of a team that drives, at the speed of real time."""
    team = TeamFixture()
    try:
        start_line(team)
        team.wait_for_go()
        layout = "side=&dock=&theme=light&layers=map,robots,labels,scans,follow,trails"
        screen = open_page(browser, start_view(team), FILM_SCREEN, layout, {"follow": 1, "scale": 38})
        left, top = screen.ask(
            "(({ left, top }) => [left, top])(document.querySelector('#scene').getBoundingClientRect())"
        )
        part = {"x": left, "y": top, "width": FILM_SIZE[0], "height": FILM_SIZE[1]}
        team.sim.set_speed(3.0)
        screen.wait("moment => zteam.app.store.frame.stamp > moment", FILM_START)
        team.sim.set_speed(FILM_SPEED)
        screen.wait("zteam.app.store.team.sim.rtf < 0.1")
        start = screen.ask("zteam.app.store.frame.stamp")
        pictures = []
        for number in range(1, FILM_PICTURES + 1):
            screen.wait(FILM_READY, start + number * FILM_STEP - 1e-6)
            pictures.append(Image.open(io.BytesIO(screen.page.screenshot(clip=part))).convert("RGB"))
    finally:
        team.close()
    path = FOLDER / f"{FILM}.webp"
    first, *others = pictures
    milliseconds = round(1000 * FILM_STEP)
    first.save(path, save_all=True, append_images=others, duration=milliseconds, loop=0, quality=60, method=6)
    report(path, MOST_FILM_BYTES)


def main() -> None:
    """Make the pictures that are named, by default all."""
    FOLDER.mkdir(exist_ok=True)
    wanted = set(sys.argv[1:]) or {FILM, *(name for scene in SCENES for name in scene.pictures)}
    with chromium() as browser:
        for scene in SCENES:
            if wanted & scene.pictures.keys():
                show(browser, scene)
        if FILM in wanted:
            film(browser)


if __name__ == "__main__":
    main()
