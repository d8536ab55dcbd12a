"""The page by keyboard alone, for screen readers, with large text and by touch."""

import math
from itertools import zip_longest

import pytest

from support.browser import PHONE, SMALL, TARGET, OpenScreen, Screen, complaints, start_view
from zteam import names
from zteam.geometry import yaw_from_quaternion
from zteam.messages import Message, PoseStamped, PoseWithCovarianceStamped
from zteam.team.testing.team import TeamFixture

FOCUSED = "document.activeElement.id"
FONTS = """
  window.fonts = {};
  const draw = CanvasRenderingContext2D.prototype.fillText;
  CanvasRenderingContext2D.prototype.fillText = function (text, ...rest) {
    const size = Number(/([0-9.]+)px/.exec(this.font)[1]);
    fonts[text] = this.canvas.closest('.uplot') ? size : [size, this.canvas.height];
    draw.call(this, text, ...rest);
  };
"""
"""Has the page note how large each text on a canvas is, and the picture that the map shows of it, in pixels."""
OUTSIDE = """() => [...document.querySelectorAll('#toolbar button, #toolbar select')].filter((one) => {
  const {left, right, top, bottom} = one.getBoundingClientRect();
  const inside = left >= 0 && right <= innerWidth && top >= 0 && bottom <= innerHeight;
  const hit = inside && document.elementFromPoint((left + right) / 2, (top + bottom) / 2);
  return getComputedStyle(one).display !== 'none' && !one.closest('[hidden]') && !(hit && one.contains(hit));
}).map((one) => one.outerHTML)"""
"""Controls of the tool bar that cannot be touched where they are."""


@pytest.fixture
def url(team: TeamFixture) -> str:
    """The view of a team of two robots that stand until they have a goal."""
    team.start("arena", robots=2, behavior="go_to", lockstep=False)
    return start_view(team)


def hear(team: TeamFixture, robot: int) -> list[Message]:
    """The goals and initial poses of this robot, as they arrive."""
    heard: list[Message] = []
    for name, kind in ((names.GOAL_POSE, PoseStamped), (names.INITIAL_POSE, PoseWithCovarianceStamped)):
        team.bus.subscribe(names.robot_key(robot, name), kind, lambda _key, sent: heard.append(sent))
    return heard


def press(screen: Screen, *keys: str) -> None:
    """Press keys, one after another."""
    for key in keys:
        screen.page.keyboard.press(key)


def test_a_box_that_was_clicked_takes_no_short_cut_away(url: str, team: TeamFixture, screen: Screen) -> None:
    """`p`, a layer's box, `g`, a click: a goal is sent and no initial pose; a list that was chosen from is no field."""
    screen.open(url, 2)
    heard = hear(team, 0)
    screen.page.click("#tab-layers")
    screen.select(0)
    press(screen, "p")
    screen.page.click("text=Laser beams")
    assert screen.ask(FOCUSED) == "layer-beams"
    press(screen, "g")
    screen.page.mouse.click(*screen.place(0.5, 1.0))
    team.wait_for(lambda: len(heard) > 0)
    assert [type(message) for message in heard] == [PoseStamped]
    press(screen, "6")
    screen.page.select_option("[aria-label='Minimum level']", "debug")
    screen.page.focus("[aria-label='Minimum level']")
    press(screen, "r")
    assert screen.ask("zteam.app.tool") == "measure"


def test_esc_leaves_a_field_and_a_click_the_map_its_arrows(url: str, screen: Screen) -> None:
    """What was typed stays, and the next key is a short cut again; a click into the map gives it no focus."""
    screen.open(url, 2)
    press(screen, "/")
    screen.page.keyboard.type("gr")
    assert screen.ask(FOCUSED) == "log-filter"
    assert screen.ask("zteam.app.tool") == "select"
    press(screen, "Escape", "g")
    assert screen.ask("zteam.app.tool") == "goal"
    assert screen.page.input_value("#log-filter") == "gr"
    press(screen, "s", "/")
    screen.page.mouse.click(*screen.place(0.0, 0.0))
    assert screen.ask(FOCUSED) == ""
    x = screen.ask("zteam.app.camera.x")
    press(screen, "ArrowRight")
    assert screen.ask("zteam.app.camera.x") > x


def test_goals_are_set_by_keys_alone(url: str, team: TeamFixture, screen: Screen) -> None:
    """Tab to the map, Enter selects the robot under the cursor, arrows move it, `g` and Enter set a goal there."""
    screen.open(url, 2)
    screen.wait("zteam.app.store.grids.size === 1")
    heard = hear(team, 0)
    # Where a cursor begins at first: in the middle of the map.
    pose = screen.pose(0)
    screen.ask("({x, y}) => zteam.app.camera.set({x, y, scale: 50, angle: 0})", pose)
    for _ in range(40):
        if screen.ask(FOCUSED) == "map":
            break
        press(screen, "Tab")
    assert screen.ask(FOCUSED) == "map"
    press(screen, "Enter")
    assert screen.ask("[...zteam.app.store.selection]") == [0]
    assert "robot_0" in screen.page.inner_text("#map-cursor")
    before = screen.ask("zteam.app.camera.get()")
    press(screen, *["ArrowRight"] * 3, *["ArrowUp"] * 2, "Shift+ArrowUp")
    assert screen.ask("zteam.app.camera.get()") == before
    x, y = pose["x"] + 3 * 16 / 50, pose["y"] + (2 * 16 + 2) / 50
    press(screen, "g", "Enter")
    team.wait_for(lambda: len(heard) == 1)
    goal = heard[0]
    assert isinstance(goal, PoseStamped)
    assert (goal.pose.position.x, goal.pose.position.y) == pytest.approx((x, y), abs=0.03)
    # With Space the arrows give the heading.
    press(screen, "p", "Space", *["ArrowUp"] * 3)
    assert len(heard) == 1
    press(screen, "Enter")
    team.wait_for(lambda: len(heard) == 2)
    initial = heard[1]
    assert isinstance(initial, PoseWithCovarianceStamped)
    found, turn = initial.pose.pose.position, initial.pose.pose.orientation
    assert (found.x, found.y) == pytest.approx((x, y), abs=0.03)
    assert yaw_from_quaternion(turn.x, turn.y, turn.z, turn.w) == pytest.approx(math.pi / 2, abs=0.05)
    # At the border the map goes along.
    press(screen, "Escape", *["ArrowLeft"] * 40)
    assert screen.ask("zteam.app.tool") == "select"
    assert screen.ask("zteam.app.camera.x") < before["x"] - 1


def names_of_tabs(screen: Screen, place: str) -> list[str]:
    """The tabs of a row."""
    found: list[str] = screen.ask(
        "place => [...document.querySelectorAll(`${place} [role=tab]`)].map(({id}) => id)", place
    )
    return found


def test_axe_finds_nothing_in_any_panel(url: str, open_screen: OpenScreen) -> None:
    """Neither on light nor dark ground, nor in the menu, the short cuts and while driving; a planted error is found."""
    # Colours are measured at once: none may be on its way to another one.
    screen = open_screen(color_scheme="light", reduced_motion="reduce")
    screen.open(url, 2)
    screen.wait("zteam.app.store.grids.size === 1")
    panels = list(zip_longest(names_of_tabs(screen, "#panel"), names_of_tabs(screen, "#dock")))
    assert len(panels) >= 5
    for tabs in panels:
        for tab in filter(None, tabs):
            screen.page.click(f"#{tab}")
        assert complaints(screen, *(["#panel", "#dock"] if tabs != panels[0] else [])) == [], tabs
        # Of all rules only this one depends on the theme.
        press(screen, "t")
        assert complaints(screen, rules=["color-contrast"]) == [], tabs
        press(screen, "t")
    screen.page.click("#page-buttons [aria-haspopup=menu]")
    assert complaints(screen) == []
    press(screen, "Escape", "?")
    assert complaints(screen) == []
    press(screen, "Escape", "d")
    planted = "<main id=planted><button></button><p>pale words</p></main>"
    screen.ask("text => document.querySelector('#status').insertAdjacentHTML('afterbegin', text)", planted)
    screen.ask("document.querySelector('#planted').style.color = '#eeeeee'")
    found = " ".join(complaints(screen))
    for rule in ("button-name", "color-contrast", "landmark-no-duplicate-main"):
        assert rule in found


def test_a_phone_has_targets_for_fingers_and_keeps_its_tools_with_large_text(url: str, open_screen: OpenScreen) -> None:
    """Each control has 44 pixels and axe finds nothing; with text of 200 % all tools are on the screen, and work."""
    screen = open_screen(**PHONE)
    screen.open(url, 2)
    for tab in names_of_tabs(screen, "#panel"):
        # Not a tap: a badge that comes meanwhile moves the tabs.
        screen.ask("id => document.getElementById(id).click()", tab)
        assert screen.ask(SMALL, TARGET) == [], tab
    assert complaints(screen) == []
    screen.ask("document.documentElement.style.fontSize = '200%'")
    assert screen.ask("getComputedStyle(document.querySelector('#tab-team')).fontSize") == "26px"
    for state in ("open", "folded"):
        assert screen.ask(OUTSIDE) == [], state
        assert screen.ask("document.documentElement.scrollWidth") <= PHONE["viewport"]["width"]
        assert screen.ask("document.querySelector('#scene').clientHeight") > 120
        if state == "open":
            screen.ask("document.querySelector('#panel [aria-label=\"Hide panels\"]').click()")
    screen.page.tap("#tools [data-tool=goal]")
    assert screen.ask("zteam.app.tool") == "goal"


def test_text_on_the_map_and_of_plots_grows_with_the_browsers(url: str, team: TeamFixture, screen: Screen) -> None:
    """Names, what a goal says, and the axes of a plot are as large as the browser's size of text says, also when it
    changes."""
    screen.page.add_init_script(FONTS)
    # Where the map is small, only a selected robot has its whole name.
    screen.open(f"{url}&selected=0&dock=plots&plots=robot_0/odom:twist.twist.linear.x", 2)
    pose = screen.pose(0)
    goal = {"op": "goal", "robots": [0], "x": pose["x"], "y": pose["y"] - 3.0, "yaw": 0.0}
    screen.page.click("button[aria-label=Pause]")
    team.wait_for(lambda: team.sim_status.paused)
    assert screen.ask("goal => zteam.app.send(goal)", goal) == ""
    for share in (1, 2):
        screen.ask("share => { document.documentElement.style.fontSize = `${100 * share}%`; }", share)
        for text in ("robot_0", "sent"):
            screen.wait("([text, sizes]) => String(fonts[text]) === sizes", [text, f"{12 * share},{18 * share}"])
        screen.wait("size => fonts['m/s'] === size", 11 * share)
