"""The simulator's controls on the page; what they do is read from the bus."""

import math

import pytest

from support.browser import Screen, show, start_view
from zteam.team.testing.team import TeamFixture

SPARE = (0.0, -3.0)
"""A place of the arena that is free (m)."""
LIMIT = 10.0
"""Host seconds for the world to stand."""


def start(team: TeamFixture, screen: Screen, robots: int = 2) -> None:
    """A team that stands, in real time, and a page with the right to command it."""
    show(team, screen, robots)
    screen.wait("zteam.app.store.team?.sim.present")


def stand(team: TeamFixture) -> int:
    """The tick at which the world stands that was just paused: the open one may have ended after the pause."""
    team.wait_for(lambda: team.sim_status.paused)
    team.sim.stand(LIMIT)
    return team.sim_status.tick


def test_a_click_pauses_the_world_and_another_one_lets_it_go_on(team: TeamFixture, screen: Screen) -> None:
    """After Pause the tick stays the same; after Resume it grows; the button says which of them it is."""
    start(team, screen)
    screen.page.click("button[aria-label=Pause]")
    tick = stand(team)
    screen.page.wait_for_selector("button[aria-label=Resume]")
    screen.wait("tick => zteam.app.store.frame.tick === tick", tick)
    assert team.tick == tick
    screen.page.click("button[aria-label=Resume]")
    team.wait_for(lambda: not team.sim_status.paused and team.tick > tick)


def test_no_key_pauses_the_world(team: TeamFixture, screen: Screen) -> None:
    """After a click on Pause and on Resume, space and enter do nothing to the world."""
    start(team, screen)
    screen.page.click("button[aria-label=Pause]")
    screen.page.click("button[aria-label=Resume]")
    team.wait_for(lambda: not team.sim_status.paused)
    screen.page.wait_for_selector("button[aria-label=Pause]")
    tick = team.tick
    for key in ("Space", "Enter", "p"):
        screen.page.keyboard.press(key)
    # A command that came after the keys has been carried out: theirs would have been too.
    screen.page.select_option("#sim select", "2")
    team.wait_for(lambda: team.sim_status.speed == 2.0 and team.tick > tick)
    assert not team.sim_status.paused


def test_a_key_does_not_press_what_the_mouse_has_pressed(team: TeamFixture, screen: Screen) -> None:
    """Space and enter, which stop a robot, do not confirm a removal that was asked for."""
    start(team, screen)
    known = team.sim_status.robots
    screen.page.click("#robots button:has-text('robot_1')")
    screen.page.click("text=Remove")
    screen.page.wait_for_selector("text=Click again to remove")
    for key in ("Space", "Enter"):
        screen.page.keyboard.press(key)
    # It was not pressed: it asks until the question's time is over, and the robot is still selected.
    screen.page.wait_for_selector("#page-team button:text-is('Remove')")
    assert team.sim_status.robots == known


def test_steps_are_counted(team: TeamFixture, screen: Screen) -> None:
    """A paused world goes on by one tick, and by as many as the field says."""
    start(team, screen)
    screen.page.click("button[aria-label=Pause]")
    tick = stand(team)
    screen.page.click("#sim button[aria-label='One tick']")
    team.wait_for(lambda: team.tick == tick + 1)
    screen.page.click("#tab-simulator")
    screen.page.fill("input[aria-label=Ticks]", "25")
    screen.page.click("#page-simulator button:text-is('Step')")
    team.wait_for(lambda: team.tick == tick + 26)
    assert team.sim_status.paused


def test_the_speed_is_chosen(team: TeamFixture, screen: Screen) -> None:
    """The list sets the simulator's speed, and follows it when it is set elsewhere."""
    start(team, screen)
    screen.page.select_option("#sim select", "5")
    team.wait_for(lambda: team.sim_status.speed == 5.0)
    screen.page.select_option("#sim select", "0")
    team.wait_for(lambda: team.sim_status.speed is None)
    team.sim.set_speed(0.25)
    screen.wait("document.querySelector('#sim select').value === '0.25'")


def test_a_robot_is_placed_and_removed(team: TeamFixture, screen: Screen) -> None:
    """A new robot stands where the mouse was pressed, with the heading of the drag; Remove asks once more and takes it
    out of the world."""
    start(team, screen)
    known = team.sim_status.robots
    screen.page.click("#tab-simulator")
    screen.page.click("text=Place in the map")
    screen.drag(SPARE, (SPARE[0], SPARE[1] + 0.5))
    team.wait_for(lambda: len(team.sim_status.robots) == len(known) + 1)
    (new,) = set(team.sim_status.robots) - set(known)
    team.wait_for(lambda: team.robot(new).truth is not None)
    pose = team.robot(new).pose
    assert abs(pose.x - SPARE[0]) < 2 * screen.pixel
    assert abs(pose.y - SPARE[1]) < 2 * screen.pixel
    assert pose.yaw == pytest.approx(math.pi / 2, abs=0.05)
    screen.page.keyboard.press("Escape")
    screen.page.click("#tab-team")
    screen.page.click(f"#robots button:has-text('robot_{new}')")
    screen.page.click("text=Remove")
    assert new in team.sim_status.robots
    screen.confirm("Remove", "Click again to remove")
    team.wait_for(lambda: new not in team.sim_status.robots)


def test_a_refusal_is_shown(team: TeamFixture, screen: Screen) -> None:
    """A robot cannot be placed in a wall: the reply's reason stands on the page."""
    start(team, screen)
    known = team.sim_status.robots
    screen.page.click("#tab-simulator")
    screen.page.click("text=Place in the map")
    pose = team.robot(0).pose
    screen.page.mouse.click(*screen.place(pose.x, pose.y))
    text = screen.page.wait_for_selector("#toasts .error").inner_text()
    assert "no room" in text, text
    assert team.sim_status.robots == known


def test_a_reset_asks_first(team: TeamFixture, screen: Screen) -> None:
    """One click on Reset asks; the second one begins the world again at tick 0."""
    start(team, screen)
    screen.page.click("button[aria-label=Pause]")
    tick = stand(team)
    assert tick > 0
    screen.page.click("#tab-simulator")
    screen.page.click("text=Reset the world")
    assert team.tick == tick
    screen.confirm("Reset the world", "Click again to reset")
    team.wait_for(lambda: team.tick < tick)


@pytest.mark.gate
def test_a_page_without_the_token_may_only_watch(team: TeamFixture, screen: Screen) -> None:
    """All controls of the world and the tools that command are disabled; a command sent past them is refused."""
    team.start("arena", robots=1, behavior="idle", lockstep=False)
    screen.open(start_view(team).partition("#")[0], 1)
    screen.page.click("#tab-simulator")
    pause = screen.page.locator("button[aria-label=Pause]")
    assert pause.is_disabled()
    assert "watching only" in (pause.get_attribute("title") or "")
    controls = "[...document.querySelectorAll('#sim button, #sim select, #page-simulator button')]"
    enabled = f"{controls}.filter((control) => !control.disabled).length"
    assert screen.ask(enabled) == 0
    assert screen.page.locator("#tools [data-tool=goal]").is_disabled()
    assert "watching only" in screen.ask("zteam.app.send({op: 'pause'})")
    assert not team.sim_status.paused
