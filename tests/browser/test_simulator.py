"""The simulator by mouse: robots are moved, refused into walls, and the world stands while it is paused."""

import pytest

from support.browser import Screen, start_view
from zteam.team.testing.team import TeamFixture

LIMIT = 10.0
"""Host seconds for the world to stand."""


def start_arena(team: TeamFixture, screen: Screen) -> None:
    """Two idle robots on a page."""
    team.start("arena", 2, behavior="idle", lockstep=False)
    screen.open(start_view(team), 2)
    screen.wait("zteam.app.store.grids.size === 1")
    screen.ask("() => { window.said = []; zteam.app.store.on('say', (line) => said.push(line)); }")


@pytest.mark.gate
def test_a_drag_moves_a_robot(team: TeamFixture, screen: Screen) -> None:
    """The robot stays while its ghost is dragged, and is where the ghost was when the button is released."""
    start_arena(team, screen)
    before = team.robot(0).pose
    screen.tool("move")
    screen.page.mouse.move(*screen.place(before.x, before.y))
    screen.page.mouse.down()
    screen.page.mouse.move(*screen.place(1.0, -0.5), steps=8)
    assert team.robot(0).pose == before
    screen.page.mouse.up()
    near = pytest.approx((1.0, -0.5), abs=2 * screen.pixel)
    team.wait_for(lambda: (team.robot(0).pose.x, team.robot(0).pose.y) == near)
    assert team.robot(0).pose.yaw == pytest.approx(before.yaw, abs=1e-3)
    screen.wait_for_robot(0, *team.robot(0).pose[:2])
    assert not screen.ask("said")


def test_a_drag_into_a_wall_is_refused(team: TeamFixture, screen: Screen) -> None:
    """The robot stays where it was, and the page says why."""
    start_arena(team, screen)
    before = team.robot(0).pose
    screen.tool("move")
    screen.drag((before.x, before.y), (4.95, 0.0))
    screen.wait("said.some(({level, text}) => level === 'error' && text.startsWith('Robot 0 was not moved: '))")
    tick = team.tick
    team.wait_for(lambda: team.tick > tick + 2)
    assert team.robot(0).pose == before


def test_the_world_stands_while_it_is_paused(team: TeamFixture, screen: Screen) -> None:
    """A click on Pause stops the ticks, one on Step makes a single one, and one on Resume lets them go on."""
    start_arena(team, screen)
    screen.page.click("#sim [aria-label=Pause]")
    screen.wait("zteam.app.store.team.sim.state === 'paused'")
    team.sim.stand(LIMIT)
    stood = team.sim_status.tick
    assert team.sim_status.paused
    screen.page.locator("#sim button").nth(1).click()
    team.wait_for(lambda: team.sim_status.tick > stood)
    team.sim.stand(LIMIT)
    assert team.sim_status.tick == stood + 1
    screen.page.click("#sim [aria-label=Resume]")
    team.wait_for(lambda: team.sim_status.tick > stood + 3)


def test_no_key_pauses_the_world(team: TeamFixture, screen: Screen) -> None:
    """After a click on Step and Resume, space and Enter do nothing to the world: pausing needs a click."""
    start_arena(team, screen)
    screen.page.click("#sim [aria-label=Pause]")
    screen.page.click("#sim [aria-label=Resume]")
    screen.wait("zteam.app.store.team.sim.state === 'running'")
    for key in ("Space", "Enter"):
        screen.page.keyboard.press(key)
    tick = team.sim_status.tick
    team.wait_for(lambda: team.sim_status.tick > tick + 5)
    assert not team.sim_status.paused
