"""The simulator by mouse: robots are moved, and refused into walls."""

import pytest

from support.browser import Screen, show
from zteam.team.testing.team import TeamFixture


def start_arena(team: TeamFixture, screen: Screen) -> None:
    """Two idle robots on a page."""
    show(team, screen)
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
