"""The time line of a recording: by mouse and keys, on a page that commands nothing."""

import re
from collections.abc import Iterator
from typing import Any

import pytest

from support.browser import PHONE, SMALL, TARGET, OpenScreen, Screen, complaints
from support.fake_replay import PLANNED, TICKS, FakeReplay
from support.transports import wait_until_true
from support.web_view import TOKEN, open_view
from zteam.bus import MemoryHub

STATE = "document.querySelector('#recorded')?.innerText ?? ''"
SHOWN = (
    "tick => zteam.app.store.docs.replay?.tick === tick && Math.abs(zteam.app.store.poses.at(0)?.x - tick / 10) < 0.02"
)
"""Whether the bar and the map are at this tick."""
OFF = """() => [...document.querySelectorAll('#tools button, #stop, #sim button, #sim select')].filter((one) =>
  !one.disabled && one.checkVisibility({visibilityProperty: true})).map((one) => one.dataset.tool).join()"""
"""The tools and controls that can be used."""


@pytest.fixture
def replay() -> FakeReplay:
    """A recording of ten minutes that stands at its beginning."""
    return FakeReplay(MemoryHub())


@pytest.fixture
def url(replay: FakeReplay) -> Iterator[str]:
    """The page of a view of it, with the token."""
    with open_view(replay.hub.bus()) as view:
        yield f"http://127.0.0.1:{view.port}/#token={TOKEN}"


@pytest.fixture
def shown(url: str, screen: Screen) -> Screen:
    """The page, as soon as it shows the first tick."""
    screen.open(url, 1)
    screen.wait(SHOWN, 1)
    return screen


def press(screen: Screen, *keys: str) -> None:
    """Press keys, one after another."""
    for key in keys:
        screen.page.keyboard.press(key)


def changes(replay: FakeReplay, name: str) -> list[Any]:
    """The values of one kind of change that was asked for."""
    return [value for asked, value in replay.asked if asked == name]


@pytest.mark.gate
def test_it_is_played_stepped_and_dragged_by_mouse(shown: Screen, replay: FakeReplay) -> None:
    """The page says that it is recorded, follows each change, and asks for jumps ten times a second at most; the last
    place of a drag is always asked for."""
    assert re.search(r"RECORDED\s+office.mcap[\s\S]*0\.10 s\s+tick 1 of 6000", shown.ask(STATE))
    shown.page.click("#recorded [aria-label=Play]")
    shown.wait("document.querySelector('#recorded [aria-label=Pause]') !== null")
    assert not replay.status.is_paused
    shown.page.click("#recorded [aria-label=Pause]")
    wait_until_true(lambda: replay.status.is_paused)
    shown.page.click("#recorded [aria-label='A tick on']")
    shown.wait(SHOWN, 2)
    shown.page.click("#recorded [aria-label='A tick back']")
    shown.wait(SHOWN, 1)
    shown.page.select_option("#recorded select", "5")
    wait_until_true(lambda: replay.status.speed == 5.0)
    replay.asked.clear()
    box = shown.page.locator("#recorded input").bounding_box()
    assert box is not None
    y = box["y"] + box["height"] / 2
    shown.page.mouse.move(box["x"] + 9, y)
    shown.page.mouse.down()
    shown.ask("() => { window.began = performance.now(); }")
    for i in range(200):
        shown.page.mouse.move(box["x"] + 9 + i * (box["width"] - 18) / 400, y)
    shown.page.mouse.up()
    chosen, took = shown.ask(
        "[document.querySelector('#recorded input').valueAsNumber + 0.1, performance.now() - began]"
    )
    assert chosen == pytest.approx(TICKS / 20, abs=10.0)
    wait_until_true(lambda: changes(replay, "seek")[-1] == pytest.approx(chosen, abs=0.001))
    assert 1 < len(changes(replay, "seek")) <= took / 100 + 3
    shown.wait(SHOWN, replay.status.tick)


@pytest.mark.gate
def test_keys_are_for_the_recording_and_not_for_the_map(shown: Screen, replay: FakeReplay) -> None:
    """Space, arrows, Home and End; those of the map's cursor, of fields and of buttons stay what they are."""
    before = shown.ask("zteam.app.camera.get()")
    press(shown, "ArrowRight", "ArrowRight", "ArrowRight", "ArrowLeft")
    shown.wait(SHOWN, 3)
    press(shown, "Shift+ArrowRight")
    shown.wait(SHOWN, 13)
    press(shown, "Shift+ArrowLeft")
    shown.wait(SHOWN, 3)
    press(shown, "End")
    shown.wait(SHOWN, TICKS)
    press(shown, "Home")
    shown.wait(SHOWN, 1)
    press(shown, " ")
    wait_until_true(lambda: not replay.status.is_paused)
    shown.page.focus("#recorded input")
    shown.wait("zteam.app.store.docs.replay.is_paused === false")
    press(shown, " ", "ArrowRight")
    shown.wait(SHOWN, 2)
    wait_until_true(lambda: replay.status.is_paused)
    # The camera may ease by less than a pixel still; a key of the map moves it by metres.
    assert shown.ask("zteam.app.camera.get()") == pytest.approx(before, abs=1e-3)
    replay.asked.clear()
    shown.page.focus("#map")
    press(shown, "ArrowRight", " ", "Escape", "Home")
    press(shown, "/", "Home", "ArrowLeft", " ")
    shown.page.focus("#tab-team")
    press(shown, "ArrowRight", "Home")
    press(shown, "?", " ", "Escape")
    shown.page.wait_for_timeout(300)
    assert [name for name, _ in replay.asked if name != "seek"] == []


def test_a_jump_back_drops_what_was_later(url: str, screen: Screen, replay: FakeReplay) -> None:
    """Plan, scan and plot are of the time that is shown, and come again with it."""
    screen.open(f"{url}&dock=plots&plots=robot_0/odom:twist.twist.linear.x", 1)
    screen.wait(SHOWN, 1)
    later = "zteam.app.store.paths.has('robot_0/plan') && zteam.app.store.scans.get(0)?.ranges.length === 3"
    plotted = "value => document.querySelector('.chip output').innerText === value"
    for key, tick in (("End", TICKS), ("Home", 1), ("End", TICKS)):
        press(screen, key)
        screen.wait(SHOWN, tick)
        screen.wait(plotted, f"{tick / 10:g}")
        if tick > PLANNED:
            screen.wait(later)
        else:
            assert screen.ask("zteam.app.store.paths.size") == 0
            assert screen.ask("(zteam.app.store.scans.get(0)?.ranges ?? []).length") <= 1
    assert screen.ask("zteam.app.store.frame.stamp") == pytest.approx(TICKS / 10)


def test_nothing_is_commanded(shown: Screen, replay: FakeReplay) -> None:
    """No tool but Select and Measure works, stop and the simulator's controls are gone, the server refuses too; all of
    it is back without the recording."""
    assert shown.ask(OFF).strip(",") == "select,measure,fit,follow"
    press(shown, "g", "d")
    assert shown.ask("[zteam.app.tool, zteam.app.drive.mode]") == ["select", False]
    for command in ({"op": "stop_robots"}, {"op": "take", "robot": 0}, {"op": "reset"}):
        assert "recording" in shown.ask("command => zteam.app.send(command)", command)
    shown.page.click("#tab-simulator")
    assert "a recording is shown" in shown.page.inner_text("#page-simulator [role=note]")
    assert shown.page.is_disabled("#page-simulator button >> nth=0")
    assert shown.page.inner_text("#notice").strip() == ""
    replay.end()
    shown.wait("document.querySelector('#recorded').hidden && !document.querySelector('#stop').disabled")
    assert "stop" in shown.ask("document.querySelector('#stop').checkVisibility({visibilityProperty: true}) && 'stop'")


def test_a_page_that_only_watches_cannot_change_it(url: str, screen: Screen, replay: FakeReplay) -> None:
    """The time line shows where the recording is; its controls are off."""
    screen.open(url.partition("#")[0], 1)
    screen.wait(SHOWN, 1)
    assert screen.page.locator("#recorded :is(button, input, select):enabled").count() == 0
    press(screen, " ")
    screen.page.wait_for_timeout(200)
    assert replay.status.is_paused
    replay.play(7)
    screen.wait(SHOWN, 7)


def test_axe_finds_nothing_and_fingers_find_the_controls(url: str, open_screen: OpenScreen) -> None:
    """On light and dark ground, and on a phone, where each control has 44 pixels."""
    screen = open_screen(color_scheme="light", reduced_motion="reduce")
    screen.open(url, 1)
    screen.wait(SHOWN, 1)
    assert complaints(screen) == []
    press(screen, "t")
    assert complaints(screen, rules=["color-contrast"]) == []
    phone = open_screen(**PHONE)
    phone.open(url, 1)
    phone.wait(SHOWN, 1)
    assert phone.ask(SMALL, TARGET) == []
    assert phone.ask("document.documentElement.scrollWidth") <= PHONE["viewport"]["width"]
