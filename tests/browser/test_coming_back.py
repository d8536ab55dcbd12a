"""What a page shows when its server or the team goes away and comes back."""

from urllib.parse import urlsplit

import pytest

from support.browser import VIEW, Screen, show, start_view
from zteam.team.testing.team import TeamFixture

TOKEN = "kept-for-this-test"


@pytest.mark.gate
def test_a_page_outlives_its_server(team: TeamFixture, screen: Screen) -> None:
    """Without the server the page says so and shows no robots; with a new one it goes on by itself, and may command."""
    team.start("arena", 2, behavior="idle", lockstep=False)
    url = start_view(team, "--token", TOKEN)
    screen.open(url, 2)
    screen.wait("zteam.app.store.grids.size === 1")
    viewport = screen.ask("zteam.app.camera.viewport()")
    team.kill(VIEW)
    screen.page.wait_for_selector("#notice .bad strong:text('server is gone')")
    assert screen.page.locator("button[aria-label=Pause]").is_disabled()
    assert screen.ask("zteam.app.store.poses.count") == 0
    assert screen.ask("zteam.app.send({op: 'pause'})") == "not connected to the server"
    start_view(team, "--token", TOKEN, port=urlsplit(url).port or 0)
    screen.wait("zteam.app.store.connection.state === 'open' && zteam.app.store.poses.count === 2")
    assert screen.ask("zteam.app.camera.viewport()") == pytest.approx(viewport)
    assert screen.ask("zteam.app.send({op: 'pause'})") == ""
    team.wait_for(lambda: team.sim_status.paused)


@pytest.mark.gate
def test_a_page_outlives_its_team(team: TeamFixture, screen: Screen) -> None:
    """When the simulator is gone its robots are no longer drawn; a new simulator's are."""
    show(team, screen)
    screen.wait("zteam.app.store.team.sim.present")
    team.kill("sim")
    screen.page.wait_for_selector("#notice :text('The simulator is gone')")
    screen.page.wait_for_selector("#notice code:text-is('zteam-sim arena')")
    screen.page.wait_for_selector("#robots td:text-is('no world')")
    assert {*screen.page.locator("#robots tr:first-child td:nth-child(4)").all_inner_texts()} == {"–"}
    assert screen.page.locator("button[aria-label=Pause]").is_disabled()
    team.restart("sim")
    screen.wait("zteam.app.store.team.sim.present && zteam.app.store.poses.count === 2")
    tick = screen.ask("zteam.app.store.frame.tick")
    screen.wait("tick => zteam.app.store.frame.tick > tick", tick)


def test_a_lost_graphics_context_is_drawn_again(team: TeamFixture, screen: Screen) -> None:
    """When the browser takes WebGL's context away and gives it back, map and robots are there again."""
    show(team, screen, 1)
    colors = """async () => {
      const picture = await createImageBitmap(await zteam.app.scene.png());
      const ctx = new OffscreenCanvas(picture.width, picture.height).getContext('2d');
      ctx.drawImage(picture, 0, 0);
      return new Set(new Uint32Array(ctx.getImageData(0, 0, picture.width, picture.height).data.buffer)).size;
    }"""
    before = screen.ask(colors)
    screen.ask("""() => {
      window.context = document.querySelector('#scene canvas').getContext('webgl2').getExtension('WEBGL_lose_context');
      context.loseContext();
    }""")
    screen.wait("document.querySelector('#scene canvas').getContext('webgl2').isContextLost()")
    screen.ask("context.restoreContext()")
    screen.wait("!document.querySelector('#scene canvas').getContext('webgl2').isContextLost()")
    screen.wait(f"async () => (await ({colors})()) > {before // 2}")
