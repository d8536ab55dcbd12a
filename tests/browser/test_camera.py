"""Mouse, keys and fingers move the view and select robots."""

from typing import Any

import pytest

from support.browser import OpenScreen, Screen, show, start_view
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

PHONE = {"viewport": {"width": 390, "height": 780}, "has_touch": True, "is_mobile": True, "device_scale_factor": 2}
SIZES = """window.sizes = [];
const keep = ([{ contentRect: { width, height } }]) => sizes.push([width, height]);
addEventListener('DOMContentLoaded', () => new ResizeObserver(keep).observe(document.querySelector('#scene')));"""
"""The sizes that the map has had."""


@pytest.fixture
def arena(team: TeamFixture, screen: Screen) -> Screen:
    """Two idle robots on a page."""
    show(team, screen)
    return screen


def selection(screen: Screen) -> list[int]:
    """The selected robots."""
    return sorted(screen.ask("[...zteam.app.store.selection]"))


def test_a_page_begins_with_the_robots(team: TeamFixture, screen: Screen) -> None:
    """In an office of 50 m it shows three metres round them; `Home` shows the whole map."""
    show(team, screen, world="office")
    xmin, ymin, xmax, ymax = screen.ask("zteam.app.camera.viewport()")
    places = screen.ask("[0, 1].map((id) => zteam.app.store.poses.at(id))")
    for pose in places:
        assert xmin + 2.0 < pose["x"] < xmax - 2.0
        assert ymin + 2.0 < pose["y"] < ymax - 2.0
    assert min(xmax - xmin, ymax - ymin) < 20.0
    screen.page.keyboard.press("Home")
    xmin, ymin, xmax, ymax = screen.ask("zteam.app.camera.viewport()")
    assert min(xmax - xmin, ymax - ymin) > 20.0


IN_VIEW = """(margin) => {
  const [xmin, ymin, xmax, ymax] = zteam.app.camera.viewport(), { poses } = zteam.app.store;
  const isSeen = (x, y) => x > xmin + margin && y > ymin + margin && x < xmax - margin && y < ymax - margin;
  return [0, 1].map((id) => poses.drawn(id)).map(({ x, y }) => isSeen(x, y));
}"""
"""Whether each of two robots is in the view, so many metres from its edge."""
OUTSIDE = "[...document.querySelectorAll('.outside:not([hidden])')].map((arrow) => arrow.textContent)"


def test_the_team_stays_in_view_until_the_user_moves_the_map(team: TeamFixture, screen: Screen) -> None:
    """The view goes along with robots that leave it, also when a panel takes room; after a move of the map it stays
    where it is, and `f` takes the team up again."""
    show(team, screen, world="office")
    pose = screen.pose(0)
    team.sim.move(1, pose["x"] + 12.0, pose["y"], 0.0)
    screen.wait_for_robot(1, pose["x"] + 12.0, pose["y"])
    screen.wait(f"({IN_VIEW})(1.4).every(Boolean)")
    screen.page.keyboard.press("6")
    screen.wait("document.querySelector('#scene').clientHeight < 600")
    screen.wait(f"({IN_VIEW})(1.4).every(Boolean)")
    screen.page.keyboard.press("ArrowLeft")
    before = screen.ask("zteam.app.camera.get()")
    team.sim.move(1, pose["x"] + 30.0, pose["y"], 0.0)
    screen.wait_for_robot(1, pose["x"] + 30.0, pose["y"])
    screen.wait(f"({OUTSIDE}).join() === 'robot_1'")
    assert screen.ask("zteam.app.camera.get()") == before
    screen.page.keyboard.press("f")
    screen.wait(f"({IN_VIEW})(1.4).every(Boolean)")


def test_arrows_at_the_edge_lead_to_robots_outside(arena: Screen) -> None:
    """Each robot outside of the view has one with its name; a click on it brings the robot into view."""
    assert arena.ask(OUTSIDE) == []
    arena.ask("zteam.app.camera.set({ x: 60, y: 0, scale: 60 })")
    arena.wait(f"({OUTSIDE}).sort().join() === 'robot_0,robot_1'")
    # Where there is hardly any map left they share a place.
    arena.page.set_viewport_size({"width": 1280, "height": 160})
    arena.wait(f"({OUTSIDE}).length === 1")
    arena.page.set_viewport_size({"width": 1280, "height": 800})
    arena.page.click(".outside:has-text('robot_1')")
    arena.wait(f"({IN_VIEW})(1)[1]")
    assert arena.ask("zteam.app.camera.scale") == 60


@pytest.mark.parametrize("options", [{}, PHONE], ids=["desk", "phone"])
def test_the_map_keeps_its_size_when_the_panels_come(team: TeamFixture, open_screen: OpenScreen, options: Any) -> None:
    """Bars and closed panels take their room before they have loaded, so that the map does not jump under the mouse."""
    screen = open_screen(**options)
    screen.page.add_init_script(SIZES)
    screen.open(start_view(team))
    screen.wait("document.querySelector('#status').childElementCount > 0")
    sizes = screen.ask("new Promise((done) => requestAnimationFrame(() => setTimeout(() => done(sizes))))")
    assert len(sizes) == 1, sizes


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
    screen = open_screen(**PHONE)
    show(team, screen)
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


WATCH = """() => {
  const { store, scene } = zteam.app;
  Object.assign(window, { pictures: new Map(), others: [], turning: 0, outside: 0 });
  let last = null;
  scene.painters.push(() => {
    const newest = JSON.stringify(store.poses.at(0)), drawn = store.poses.drawn(0), other = store.poses.drawn(1);
    if (store.poses.left < 1) pictures.set(newest, (pictures.get(newest) ?? new Set()).add(JSON.stringify(drawn)));
    others.push(other.x);
  });
  store.on('scans', () => {
    const scan = [...store.scans.values()].find((scan) => scan.robot === 0);
    if (scan === undefined || (last !== null && scan.yaw === last.yaw)) return;
    if (last !== null && Math.abs(Math.sin(scan.yaw - last.yaw)) > 0.05) turning++;
    last = scan;
    scan.ranges.forEach((range, i) => {
      if (range >= 0xfffe) return;
      const angle = scan.yaw + scan.angleMin + i * scan.angleIncrement, metres = range * scan.step;
      const [x, y] = [scan.x + metres * Math.cos(angle), scan.y + metres * Math.sin(angle)];
      outside = Math.max(outside, Math.abs(x), Math.abs(y));
    });
  });
}"""
"""Notes where robots are drawn, and how far the ends of robot 0's beams are from the middle of the arena (m)."""


def test_motion_is_smooth_and_scans_lie_on_the_walls(team: TeamFixture, arena: Screen) -> None:
    """A robot that turns and drives is drawn between its poses, its beams end at walls; one that is moved jumps."""
    # A tick a second: also a crowded machine draws several pictures in between, the smaller ones sooner.
    arena.page.set_viewport_size({"width": 800, "height": 400})
    team.sim.set_speed(0.1)
    arena.select(0)
    arena.page.keyboard.press("d")
    arena.wait("zteam.app.drive.mode")
    arena.page.keyboard.down("u")
    team.wait_for(lambda: team.robot(0).speed > 0.1)
    arena.ask(WATCH)
    arena.wait("[...pictures.values()].some((places) => places.size > 2)")
    team.sim.set_speed(1.0)
    arena.wait("turning >= 10")
    assert 4.8 < arena.ask("outside") < 5.05
    before = arena.ask("zteam.app.store.poses.at(1).x")
    team.sim.move(1, 3.0, -1.0, 0.0)
    arena.wait_for_robot(1, 3.0, -1.0)
    arena.wait("Math.abs(others.at(-1) - 3) < 0.02")
    assert {round(x, 1) for x in arena.ask("others")} == {round(before, 1), 3.0}
    team.sim.pause()
    arena.wait("zteam.app.store.team.sim.state === 'paused'")
    drawn = "(({poses}) => poses.left === 0 && ['x', 'y', 'yaw'].every((k) => poses.drawn(0)[k] === poses.at(0)[k]))"
    arena.wait(f"{drawn}(zteam.app.store)")
    arena.page.keyboard.up("u")
