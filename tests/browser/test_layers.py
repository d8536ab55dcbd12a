"""What a node of one's own publishes is drawn where it lies, and only while its layer is shown."""

import io
import math
from collections.abc import Callable

import numpy as np
import pytest
from PIL import Image

from support.browser import Screen, show
from zteam.messages import (
    ColorRGBA,
    Header,
    MapMetaData,
    Marker,
    MarkerArray,
    Message,
    OccupancyGrid,
    Path,
    Point,
    Pose,
    PoseArray,
    PoseStamped,
    Quaternion,
    Vector3,
)
from zteam.team.testing.team import TeamFixture

X, Y = 2.5, 0.5
"""A place of the arena where nothing stands, between the lines of the grid."""
MAP = Header(frame_id="map")
CUBE = 1


def pose(x: float, y: float) -> Pose:
    """A pose in map, along x."""
    return Pose(Point(x, y), Quaternion())


def plan() -> Message:
    """A path across the place."""
    return Path(header=MAP, poses=[PoseStamped(header=MAP, pose=pose(X + step, Y)) for step in (-0.5, 0.0, 0.5)])


def particles() -> Message:
    """Poses around the place, so close that they leave no gap."""
    return PoseArray(header=MAP, poses=[pose(X + 0.02 * i, Y + 0.01 * j) for i in range(-9, 1) for j in range(-9, 9)])


def costs() -> Message:
    """A square of high costs."""
    info = MapMetaData(resolution=0.1, width=8, height=8, origin=pose(X - 0.4, Y - 0.4))
    return OccupancyGrid(header=MAP, info=info, data=np.full(64, 90, np.int8))


def markers() -> Message:
    """A red cube, turned by an eighth."""
    turned = Pose(Point(X, Y), Quaternion(z=math.sin(math.pi / 8), w=math.cos(math.pi / 8)))
    cube = Marker(
        header=MAP, ns="test", type=CUBE, pose=turned, scale=Vector3(0.4, 0.4, 0.4), color=ColorRGBA(1.0, 0.0, 0.0, 1.0)
    )
    return MarkerArray(markers=[cube])


@pytest.mark.parametrize(
    ("layer", "key", "make"),
    [
        ("plans", "robot_0/plan", plan),
        ("particles", "robot_0/particle_cloud", particles),
        ("costmaps", "robot_0/local_costmap/costmap", costs),
        ("markers", "robot_1/visualization_marker_array", markers),
    ],
)
def test_a_layer_draws_what_a_node_publishes(
    team: TeamFixture, screen: Screen, layer: str, key: str, make: Callable[[], Message]
) -> None:
    """The ground at the place is coloured while the layer is shown, and white again without it."""
    show(team, screen)
    message = make()
    publisher = team.bus.publisher(key, type(message))

    def color() -> list[int]:
        x, y = screen.place(X, Y)
        picture = Image.open(io.BytesIO(screen.page.screenshot())).convert("RGB")
        return [*picture.getpixel((round(x), round(y)))]  # type: ignore[misc]

    def is_ground() -> bool:
        return min(color()) > 245

    for shown in (True, False):
        screen.ask("([layer, on]) => zteam.app.layers.set(layer, on)", [layer, shown])

        def arrived(shown: bool = shown) -> bool:
            publisher.put(message)
            return is_ground() is not shown

        team.wait_for(arrived)
    screen.ask("layer => zteam.app.layers.set(layer, true)", layer)
    team.wait_for(lambda: not is_ground())


def test_costmaps_leave_the_map_in_sight_and_obey_opacity_and_robots(team: TeamFixture, screen: Screen) -> None:
    """Three costmaps above each other are as light as one; the slider makes them denser, and without their robots they
    are gone. The layout has all of it."""
    show(team, screen)
    info = MapMetaData(resolution=0.1, width=8, height=8, origin=pose(X - 0.4, Y - 0.4))
    grid = OccupancyGrid(header=MAP, info=info, data=np.full(64, 100, np.int8))
    keys = ("robot_0/local_costmap/costmap", "robot_0/global_costmap/costmap", "robot_1/local_costmap/costmap")
    publishers = {key: team.bus.publisher(key, OccupancyGrid) for key in keys}
    screen.page.click("#tab-layers")
    screen.page.check("text=Costmaps")

    def arrived() -> bool:
        for publisher in publishers.values():
            publisher.put(grid)
        return bool(screen.ask("keys => keys.every((key) => zteam.app.store.grids.has(key))", list(keys)))

    def green() -> int:
        """Of lethal magenta on white ground: 255 without it, 0 under an opaque one."""
        x, y = screen.place(X, Y)
        picture = Image.open(io.BytesIO(screen.page.screenshot())).convert("RGB")
        return int(picture.getpixel((round(x), round(y)))[1])  # type: ignore[index]

    team.wait_for(arrived)
    assert green() == pytest.approx(0.6 * 255, abs=4)
    screen.page.focus("input[aria-label='Opacity of Costmaps']")
    for _ in range(8):
        screen.page.keyboard.press("ArrowRight")
    team.wait_for(lambda: green() == pytest.approx(0.2 * 255, abs=4))
    robots = "details[aria-label='Robots: Navigation']"
    screen.page.click(f"{robots} summary")
    screen.page.uncheck(f"{robots} >> text=robot_0")
    screen.wait("location.hash.includes('styles=costmaps:80,navigation-0')")
    assert green() == pytest.approx(0.2 * 255, abs=4)
    screen.page.click(f"{robots} >> text=None")
    team.wait_for(lambda: green() > 245)
    layout = "styles => { zteam.app.layers.styles = styles; return zteam.app.layers.styles; }"
    assert (
        screen.ask(layout, "costmaps:60,navigation-0-1,nothing:3,navigation-x,map:0")
        == "costmaps:60,map:5,navigation-0-1"
    )
    assert screen.page.inner_text(f"{robots} summary") == "Robots: 0 of 2"
    assert screen.ask(layout, "") == ""
    team.wait_for(lambda: green() == pytest.approx(0.6 * 255, abs=4))
