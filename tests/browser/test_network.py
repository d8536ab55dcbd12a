"""What a page loads before its first robot, for slow links."""

from typing import Any

from support.browser import Screen, start_view
from zteam.team.testing.team import TeamFixture

MOST = 120_000
"""Bytes of files before the first robot: at 50 kB/s these take 2.4 s."""


def test_the_map_comes_before_the_panels_and_in_few_bytes(team: TeamFixture, screen: Screen) -> None:
    """Robots are drawn while the modules of the panels have not come; they come later, and show the team."""
    team.start("arena", 2, behavior="go_to", lockstep=False)
    url = start_view(team)
    waiting: list[Any] = []
    sizes: list[int] = []
    held = [True]

    def hold(route: Any) -> None:
        waiting.append(route) if held[0] else route.continue_()

    screen.page.on("response", lambda response: sizes.append(int(response.headers.get("content-length", 0))))
    screen.page.route("**/js/panels/**", hold)
    screen.open(url, 2, panels=False)
    screen.wait("zteam.stats.frames > 0")
    assert waiting and 0 < sum(sizes) < MOST
    assert screen.page.locator("#panel tr").count() == 0
    held[0] = False
    for route in waiting:
        route.continue_()
    screen.page.locator("#panel").get_by_text("robot_1").first.wait_for()


def test_a_page_whose_panels_do_not_load_says_so(screen: Screen, team: TeamFixture) -> None:
    """The map is there, and what the user has to do."""
    team.start("arena", 1, behavior="idle", lockstep=False)
    screen.page.route("**/js/panels/main.js", lambda route: route.abort())
    screen.open(start_view(team), 1, panels=False)
    screen.wait("document.querySelector('#notice').textContent.includes('Reload the page')")
    assert screen.complaints, "the browser's console has the cause"
    screen.complaints.clear()
