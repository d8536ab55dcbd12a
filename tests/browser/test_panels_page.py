"""Layouts, themes, short cuts, the picture, narrow screens."""

import json
from pathlib import Path

import pytest

from support.browser import OpenScreen, Screen, start_view
from zteam.team.testing.team import TeamFixture

SHOWN = "name => !document.querySelector(`#page-${name}`).hidden"
COVERED = """() => {
  const button = document.querySelector("#panel [aria-label='Hide panels']");
  const { left, right, top, bottom } = button.getBoundingClientRect(), places = [left + 1, right - 1, innerWidth - 2];
  const found = places.flatMap((x) => document.elementsFromPoint(x, (top + bottom) / 2));
  return found.filter((one) => one.matches('[role=tab]')).map((one) => one.textContent);
}"""
"""Tabs that are under the button which folds them, or beyond it."""
THEME = "document.documentElement.dataset.theme"


@pytest.fixture
def url(team: TeamFixture) -> str:
    """The view of a team of two robots that stand."""
    team.start("arena", robots=2, behavior="idle", lockstep=False)
    return start_view(team)


def arrange(screen: Screen) -> None:
    """Make the view another one than at first."""
    screen.page.click("#tab-layers")
    screen.page.check("text=Laser beams")
    screen.page.uncheck("text=Trails")
    screen.page.click("#tab-team")
    screen.page.click("#robots button:has-text('robot_1')")
    screen.page.click("#tab-topics")
    screen.page.click("#topics [data-topic='robot_1/odom'] button")
    screen.page.click("button[aria-label='Plot twist.twist.linear.x']")
    screen.ask("zteam.app.camera.set({x: 1.25, y: -0.5, scale: 100, angle: 0.5})")
    screen.page.keyboard.press("t")


def leave(screen: Screen) -> None:
    """End a page: two that draw in software at once are slow."""
    screen.page.goto("about:blank")


def assert_arranged(screen: Screen) -> None:
    """The view is as `arrange` has made it."""
    screen.wait("document.querySelectorAll('#page-plots .chip').length === 1")
    layers = screen.ask("[...zteam.app.layers.shown]")
    assert "beams" in layers
    assert "trails" not in layers
    assert screen.ask("zteam.app.camera.get()") == {"x": 1.25, "y": -0.5, "scale": 100, "angle": 0.5, "follow": -1}
    assert screen.ask(SHOWN, "topics")
    assert screen.ask(SHOWN, "plots")
    screen.page.wait_for_selector(".echo :text-is('robot_1/odom')")
    assert screen.ask("[...zteam.app.store.selection]") == [1]
    assert screen.ask(THEME) == "dark"


def test_the_address_holds_the_view_and_no_token(url: str, open_screen: OpenScreen) -> None:
    """Another browser that opens the address sees the same, and may only watch."""
    first = open_screen(color_scheme="light")
    first.open(url, 2)
    arrange(first)
    first.wait("location.hash.includes('selected=1') && location.hash.includes('theme=dark')")
    address = first.page.url
    assert "token" not in address
    leave(first)
    second = open_screen(color_scheme="light")
    second.open(address, 2)
    assert_arranged(second)
    assert not second.ask("zteam.app.store.connection.mayCommand")


def test_a_layout_may_select_a_robot_before_it_comes(modules: Screen) -> None:
    """The selection outlives documents of a team without the robot; it goes when the robot was there and is gone."""
    found = modules.ask("""async () => {
      const {Store} = await import('/page/js/store.js');
      const store = new Store();
      store.select([1]);
      return [[], [0], [0, 1], [0]].map((ids) => {
        const block = {type: 'doc', name: 'team', value: {robots: ids.map((id) => ({id, outline: -1})), outlines: []}};
        store.takeFrame({number: 1, tick: 1, stamp: 1, age: -1, blocks: [block]}, 0);
        return [...store.selection];
      });
    }""")
    assert found == [[1], [1], [1], []]


def test_a_layout_is_saved_and_opened(url: str, open_screen: OpenScreen, tmp_path: Path) -> None:
    """The file that the page saves makes the same view on another page."""
    first = open_screen(color_scheme="light")
    first.open(url, 2)
    arrange(first)
    with first.page.expect_download() as download:
        first.page.click("#page-buttons [aria-haspopup=menu]")
        first.page.click("text=Save the layout as a file")
    file = tmp_path / "layout.json"
    download.value.save_as(file)
    assert json.loads(file.read_text())["version"] == 1
    leave(first)
    second = open_screen(color_scheme="light")
    second.open(url, 2)
    second.page.set_input_files("input[type=file]", file)
    assert_arranged(second)


def test_a_view_begins_with_the_layout_of_its_file(team: TeamFixture, screen: Screen, tmp_path: Path) -> None:
    """`zteam view --layout FILE` gives the page its first layout; the address is newer and comes after it."""
    file = tmp_path / "layout.json"
    file.write_text(
        json.dumps({"version": 1, "side": "layers", "layers": "map,robots,beams", "camera": "1.00,2.00,50,0"})
    )
    team.start("arena", robots=1, behavior="idle", lockstep=False)
    url = start_view(team, "--layout", str(file))
    screen.open(f"{url}&layers=map,robots", 1)
    screen.wait(SHOWN, "layers")
    assert sorted(screen.ask("[...zteam.app.layers.shown]")) == ["map", "robots"]
    assert screen.ask("zteam.app.camera.get().scale") == 50


def test_a_file_that_is_no_layout_is_refused(url: str, screen: Screen, tmp_path: Path) -> None:
    """The page says what is wrong with it, and stays as it was."""
    screen.open(url, 2)
    file = tmp_path / "other.json"
    for text, reason in (
        ("{", "SyntaxError"),
        ('{"version": 9}', "no layout of version 1"),
        ('{"version": 1, "x": 1}', "x"),
    ):
        file.write_text(text)
        screen.page.set_input_files("input[type=file]", file)
        screen.page.wait_for_selector(f"#toasts .error:has-text({reason!r})")
    assert screen.ask(SHOWN, "team")


def test_the_theme_is_the_systems_until_it_is_chosen(url: str, open_screen: OpenScreen) -> None:
    """Dark where the system is; `t` changes it, and the choice outlives a reload."""
    screen = open_screen(color_scheme="dark")
    screen.open(url, 2)
    assert screen.ask(THEME) == "dark"
    screen.page.keyboard.press("t")
    assert screen.ask(THEME) == "light"
    screen.page.evaluate("history.replaceState(null, '', '/')")
    screen.page.reload()
    screen.wait("window.zteam?.app.store.connection.state === 'open'")
    assert screen.ask(THEME) == "light"


def test_short_cuts_are_listed_and_work(url: str, screen: Screen) -> None:
    """`?` lists them; digits choose panels, 0 folds them, / filters the log; none acts while a robot is driven."""
    screen.open(url, 2)
    screen.page.keyboard.press("?")
    screen.page.wait_for_selector("dialog[open] :text('Save a picture of the map')")
    screen.page.keyboard.press("3")
    assert not screen.ask(SHOWN, "topics")
    screen.page.keyboard.press("Escape")
    screen.wait("!document.querySelector('dialog').open")
    screen.page.keyboard.press("3")
    assert screen.ask(SHOWN, "topics")
    screen.page.keyboard.press("/")
    screen.page.keyboard.type("t1")
    assert screen.page.input_value("#log-filter") == "t1"
    assert screen.ask(SHOWN, "topics")
    screen.page.locator("#log-filter").blur()
    screen.page.keyboard.press("0")
    assert not screen.ask(SHOWN, "topics")
    screen.page.keyboard.press("0")
    screen.select(0)
    screen.page.keyboard.press("d")
    screen.wait("zteam.app.drive.mode")
    screen.page.keyboard.press("5")
    assert not screen.ask(SHOWN, "layers")


def test_a_phone_has_all_panels_in_one_drawer(url: str, open_screen: OpenScreen) -> None:
    """At 390 pixels one drawer has all nine tabs, opens and closes by touch by a button that covers none of them, and
    nothing is wider than the screen."""
    screen = open_screen(viewport={"width": 390, "height": 844}, has_touch=True, is_mobile=True)
    screen.open(url, 2)
    assert screen.page.locator("#panel [role=tab]").count() == 9
    assert screen.page.locator("#dock [role=tab]").count() == 0
    assert not screen.ask(SHOWN, "team")
    for name in ("team", "plots"):
        screen.page.tap(f"#tab-{name}")
        screen.wait(SHOWN, name)
        assert screen.ask(COVERED) == []
    assert screen.ask("document.documentElement.scrollWidth") <= 390
    screen.page.tap("#panel [aria-label='Hide panels']")
    screen.wait(f"name => !({SHOWN})(name)", "plots")
