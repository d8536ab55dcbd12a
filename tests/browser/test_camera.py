"""Mouse, keys and fingers move the view and select robots."""

from typing import Any

import pytest

from support.browser import OpenScreen, Screen, start_view
from zteam.team.testing.team import TeamFixture

MAP_AT = """([px, py]) => {
  const box = document.querySelector('#scene').getBoundingClientRect();
  return zteam.app.camera.toMap(px - box.left, py - box.top);
}"""

LIES = """([x, y, px, py]) => {
  const box = document.querySelector('#scene').getBoundingClientRect(), [left, top] = zteam.app.camera.toScreen(x, y);
  return Math.hypot(box.left + left - px, box.top + top - py) < 1.5;
}"""
"""Whether a place of the map is at these pixels of the page. A browser hands fingers' moves on once a frame."""


@pytest.fixture
def arena(team: TeamFixture, screen: Screen) -> Screen:
    """Two idle robots on a page."""
    return show_arena(team, screen)


def show_arena(team: TeamFixture, screen: Screen) -> Screen:
    """Show two idle robots on this page."""
    team.start("arena", 2, behavior="idle", lockstep=False)
    screen.open(start_view(team), 2)
    screen.wait("zteam.app.store.grids.size === 1")
    return screen


def selection(screen: Screen) -> list[int]:
    """The selected robots."""
    return sorted(screen.ask("[...zteam.app.store.selection]"))


def test_the_wheel_zooms_at_the_mouse(arena: Screen) -> None:
    """What is under the mouse stays there."""
    x, y = arena.place(2.0, 1.0)
    mouse = [round(x), round(y)]
    arena.page.mouse.move(*mouse)
    before, under = arena.pixel, arena.ask(MAP_AT, mouse)
    arena.page.mouse.wheel(0, -400)
    arena.wait("pixel => 1 / zteam.app.camera.scale < 0.7 * pixel", before)
    assert arena.ask(MAP_AT, mouse) == pytest.approx(under, abs=1e-6)


def test_drags_move_and_turn_the_map(arena: Screen) -> None:
    """The left button takes the map along, the right one turns it about the middle of the screen."""
    x, y = arena.place(0.0, -2.0)
    arena.page.mouse.move(x, y)
    arena.page.mouse.down()
    arena.page.mouse.move(x + 80, y + 30, steps=4)
    arena.page.mouse.up()
    assert arena.place(0.0, -2.0) == pytest.approx((x + 80, y + 30), abs=0.5)
    assert selection(arena) == [], "a drag is no click"
    arena.page.mouse.down(button="right")
    arena.page.mouse.move(x + 200, y - 100, steps=4)
    arena.page.mouse.up(button="right")
    assert abs(arena.ask("zteam.app.camera.angle")) > 0.2
    arena.page.keyboard.press("n")
    assert arena.ask("zteam.app.camera.angle") == pytest.approx(0.0, abs=1e-9)


def test_robots_are_selected_by_click_and_box(arena: Screen) -> None:
    """A click selects one, with shift it adds or takes away, a box with shift adds, a click beside all selects none."""
    arena.select(0)
    arena.select(1)
    assert selection(arena) == [1]
    arena.select(1, 0)
    arena.page.keyboard.down("Shift")
    arena.page.mouse.click(*arena.place(-3.5, 0.0))
    arena.page.keyboard.up("Shift")
    assert selection(arena) == [0]
    arena.page.mouse.click(*arena.place(3.0, -4.0))
    assert selection(arena) == []
    arena.page.keyboard.down("Shift")
    arena.drag((-4.5, 1.0), (0.0, -1.0))
    arena.page.keyboard.up("Shift")
    assert selection(arena) == [0, 1]
    arena.page.keyboard.press("Escape")
    arena.page.mouse.click(*arena.place(3.0, -4.0))
    arena.page.keyboard.press("Control+a")
    assert selection(arena) == [0, 1]


def test_the_camera_follows_a_robot(team: TeamFixture, arena: Screen) -> None:
    """The followed robot stays in the middle of the screen while it is moved; moving the map ends that."""
    arena.select(1)
    arena.page.keyboard.press("Shift+F")
    team.sim.move(1, 3.0, -1.0, 0.0)
    arena.wait("Math.hypot(zteam.app.camera.x - 3, zteam.app.camera.y + 1) < 0.02")
    arena.page.keyboard.press("ArrowLeft")
    assert arena.ask("zteam.app.camera.follow") == -1


def test_the_measure_is_that_of_the_map(arena: Screen) -> None:
    """The line between two corners of the arena's walls is as long as the wall."""
    arena.tool("measure")
    arena.ask("""() => {
      window.texts = [];
      const draw = CanvasRenderingContext2D.prototype.fillText;
      CanvasRenderingContext2D.prototype.fillText = function (text, ...rest) {
        texts.push(text);
        return draw.call(this, text, ...rest);
      };
    }""")
    arena.drag((-4.9, -4.9), (-4.9, 4.9))
    arena.wait("texts.some((text) => /^9[.][78]\\d+ m  90°$/.test(text))")


def test_two_fingers_zoom_and_turn_and_one_moves(team: TeamFixture, open_screen: OpenScreen) -> None:
    """On a phone: the places of the map under the fingers stay under them."""
    screen = show_arena(
        team, open_screen(viewport={"width": 390, "height": 780}, has_touch=True, is_mobile=True, device_scale_factor=2)
    )
    session = screen.page.context.new_cdp_session(screen.page)

    def touch(kind: str, *fingers: tuple[float, float]) -> None:
        points: Any = [{"x": x, "y": y, "id": i} for i, (x, y) in enumerate(fingers)]
        session.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})

    first, second = (150.0, 350.0), (250.0, 350.0)
    under = [screen.ask(MAP_AT, list(finger)) for finger in (first, second)]
    touch("touchStart", first)
    touch("touchStart", first, second)
    for i in range(1, 9):
        touch("touchMove", (150.0 - 5 * i, 350.0 + 6 * i), (250.0 + 6 * i, 350.0 - 8 * i))
    ends = (110.0, 398.0), (298.0, 286.0)
    for place, end in zip(under, ends, strict=True):
        screen.wait(LIES, [*place, *end])
    touch("touchEnd")
    assert abs(screen.ask("zteam.app.camera.angle")) > 0.3
    assert selection(screen) == []
    place = screen.ask(MAP_AT, [200.0, 400.0])
    touch("touchStart", (200.0, 400.0))
    for i in range(1, 6):
        touch("touchMove", (200.0 + 10 * i, 400.0))
    screen.wait(LIES, [*place, 250.0, 400.0])
    touch("touchEnd")
