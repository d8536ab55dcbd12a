"""The red button: every page stops the robots, a page with the token releases them, and "Cancel all" holds."""

from pathlib import Path

import pytest

from support.browser import OpenScreen, Screen, start_view
from support.navigated_team import FAKE
from zteam import names
from zteam.team.testing.team import TeamFixture

BANNER = "document.querySelector('#notice .stopped')"
SAID = f"({BANNER}.hidden ? '' : {BANNER}.innerText)"
STATES = "[...document.querySelectorAll('#robots tbody tr:first-child td:nth-child(2)')].map((c) => c.innerText).join()"
PAD = """() => {
  window.pad = {connected: true, axes: [0, 0], buttons: [{}, {pressed: false}]};
  navigator.getGamepads = () => [pad];
  window.dispatchEvent(new Event('gamepadconnected'));
}"""


def stands(team: TeamFixture) -> bool:
    """Whether both robots are stopped, by their own word and by the simulator's."""
    said = [team.robot(i).status for i in (0, 1)]
    return team.sim_status.stopped == [0, 1] and all(status is not None and status.is_stopped for status in said)


def test_a_page_that_only_watches_stops_and_does_not_release(team: TeamFixture, open_screen: OpenScreen) -> None:
    """Its button, big enough for a thumb, stops all robots; each page's banner and table say so; only a page with the
    token releases them, at its second click."""
    team.start("arena", 2, behavior="wander", lockstep=False)
    team.wait_for_go()
    url = start_view(team)
    phone = open_screen(viewport={"width": 390, "height": 844}, has_touch=True, is_mobile=True)
    phone.open(url.partition("#")[0], 2)
    desk = open_screen()
    desk.open(url, 2)
    box = phone.page.locator("#stop").bounding_box()
    assert box is not None
    assert box["width"] >= 44
    assert box["height"] >= 44
    assert box["x"] >= 0.0
    assert box["x"] + box["width"] <= 390
    phone.page.tap("#stop")
    team.wait_for(lambda: stands(team))
    for screen in (phone, desk):
        screen.wait(f"{SAID}.includes('All robots stand, whatever drives them.')")
    desk.wait(f"{STATES} === 'held,held'")
    assert phone.page.locator("#notice .stopped button").is_disabled()
    desk.confirm("Release", "Click again to release")
    team.wait_for(lambda: not team.sim_status.stopped)
    phone.wait(f"{SAID} === ''")
    team.wait_for(lambda: any(team.robot(i).speed > 0.1 for i in (0, 1)))


@pytest.mark.parametrize("way", ["key", "pad"])
def test_key_and_pad_stop_also_while_they_drive(team: TeamFixture, screen: Screen, way: str) -> None:
    """Shift+Space and the right one of a gamepad's four buttons stop the robot that this page drives; in a field for
    text the key writes."""
    team.start("arena", 2, behavior="idle", lockstep=False)
    team.wait_for_go()
    screen.open(start_view(team), 2)
    screen.page.keyboard.press("6")
    screen.page.locator("#log-filter").focus()
    screen.page.keyboard.press("Shift+Space")
    screen.page.keyboard.press("Escape")
    screen.select(0)
    screen.page.keyboard.press("d")
    screen.page.keyboard.down("j")
    team.wait_for(lambda: team.robot(0).command is not None and team.robot(0).command.angular.z > 0.3)
    assert team.sim_status.stopped == []
    if way == "key":
        screen.page.keyboard.press("Shift+Space")
    else:
        screen.ask(PAD)
        screen.ask("pad.buttons[1].pressed = true")
    team.wait_for(lambda: stands(team))
    team.wait_for(lambda: team.robot(0).command is not None and team.robot(0).command.angular.z == 0.0)


def test_cancel_all_holds(team: TeamFixture, screen: Screen, tmp_path: Path) -> None:
    """The robot of a list gets no next goal until the page lets the list go on."""
    path = tmp_path / "team.toml"
    path.write_text(FAKE)
    team.launch(path, lockstep=False)
    team.wait_for_go()
    file = tmp_path / "goals.yaml"
    file.write_text("".join(f"- {{robot: 0, x: {x}, y: -1.0}}\n" for x in (2.0, -2.0, 1.0, -1.0)))
    team.spawn("zteam", "goals", str(file), "--loop", name=names.GOALS)
    screen.open(start_view(team), 2)
    screen.wait("zteam.app.store.docs.goals?.some(({state}) => state === 'driving')")
    screen.wait("zteam.app.store.team.lists[0] === false")
    screen.page.click("text='Cancel all'")
    screen.wait("zteam.app.store.team.lists[0] === true")
    screen.wait("zteam.app.store.docs.goals?.every(({state}) => state === 'canceled')")
    stopped = team.robot(0).pose
    team.run(3.0)
    screen.wait("zteam.app.store.docs.goals?.every(({state}) => state === 'canceled')")
    assert team.robot(0).pose.x == pytest.approx(stopped.x, abs=0.3)
    screen.page.click("text='Go on'")
    screen.wait("zteam.app.store.docs.goals?.some(({state}) => state === 'driving')")
