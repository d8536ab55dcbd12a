"""What a page loads before its first robot, and how it lives with a slow link."""

from contextlib import closing
from typing import Any
from urllib.parse import urlsplit

from studies.view.frames import decode_frame
from support.browser import OpenScreen, Screen, start_view
from zteam.clock import HOST_FACTOR, monotonic
from zteam.team.chaos.links import Links
from zteam.team.chaos.means import Wire
from zteam.team.testing.team import TeamFixture
from zteam.view.frames import DOC

MOST = 120_000
"""Bytes of files before the first robot: at 50 kB/s these take 2.4 s."""
DELAY = 0.2
"""Seconds of the slow link, each way."""
SLOW = Wire(delay=DELAY, rate=50_000)
FIRST_ROBOT = 6.0
"""Host seconds from the address to the first robot over the slow link."""
TRIES = 3
"""Pages that are timed at most: the link makes each of them slow, the machine's other work only some."""
DRAWN = "window.zteam?.stats.age_ms.length > 0"
"""Whether a robot was drawn."""
TIMES = """
  window.times = {arrived: {}, acknowledged: {}};
  window.WebSocket = class extends WebSocket {
    constructor(...rest) {
      super(...rest);
      this.addEventListener('message', ({data}) => {
        if (typeof data !== 'string') times.arrived[new DataView(data).getUint32(4, true)] = performance.now() / 1000;
      });
    }
    send(text) {
      const {op, frame} = JSON.parse(text);
      if (op === 'ack') times.acknowledged[frame] = performance.now() / 1000;
      super.send(text);
    }
  };
"""
"""Has the page note when each frame came and when it was acknowledged, in seconds."""
GAPS = """before => Object.entries(times.arrived).filter(([frame]) => frame - before in times.acknowledged)
  .map(([frame, came]) => came - times.acknowledged[frame - before])"""
"""Seconds from the acknowledgement of a frame until the one comes that is so many numbers later."""
FRAMES = 40


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


def documents_of(screen: Screen) -> list[str]:
    """The names of the documents that the page is sent, as they come."""
    found: list[str] = []

    def take(data: str | bytes) -> None:
        for kind, _, _, body in decode_frame(data)[1] if isinstance(data, bytes) else ():
            if kind == DOC:
                found.append(body[2 : 2 + int.from_bytes(body[:2], "little")].decode())

    screen.page.on("websocket", lambda socket: socket.on("framereceived", take))
    return found


def test_over_a_slow_link_the_first_robot_comes_soon_and_frames_two_at_a_time(
    team: TeamFixture, open_screen: OpenScreen
) -> None:
    """Over 50 kB/s and 0.4 s there and back a robot is drawn within 6 s; a frame waits for the acknowledgement of the
    last but one, not of the last; topics are sent when their panel is opened."""
    team.start("office", 4, behavior="wander", lockstep=False)
    url = urlsplit(start_view(team))
    with closing(Links()) as links:
        link = links.open("127.0.0.1", url.port or 0)
        link.change(SLOW, SLOW)
        address = url._replace(netloc=f"127.0.0.1:{link.port}").geturl()
        took: list[float] = []
        while True:
            screen = open_screen()
            screen.page.add_init_script(TIMES)
            documents = documents_of(screen)
            begin = monotonic()
            screen.page.goto(address, wait_until="commit")
            screen.wait(DRAWN)
            took.append(monotonic() - begin)
            if took[-1] < FIRST_ROBOT * HOST_FACTOR:
                break
            assert len(took) < TRIES, took
            # Two pages that draw in software are slow.
            screen.page.goto("about:blank")
        screen.wait(f"n => ({GAPS})(2).length > n", FRAMES)
        # A crowded machine may hold single bytes for less; with three frames under way many gaps would be shorter.
        gaps = sorted(screen.ask(GAPS, 2))
        assert gaps[len(gaps) // 10] > 2 * DELAY - 0.01, gaps
        screen.wait(f"shortest => Math.min(...({GAPS})(1)) < shortest", 1.5 * DELAY)
        assert "team" in documents and "topics" not in documents
        screen.page.click("#tab-topics")
        screen.page.wait_for_selector("#topics [data-topic='robot_1/odom']")
        assert "topics" in documents


def test_a_page_whose_panels_do_not_load_says_so(screen: Screen, team: TeamFixture) -> None:
    """The map is there, and what the user has to do."""
    team.start("arena", 1, behavior="idle", lockstep=False)
    screen.page.route("**/js/panels/main.js", lambda route: route.abort())
    screen.open(start_view(team), 1, panels=False)
    screen.wait("document.querySelector('#notice').textContent.includes('Reload the page')")
    assert screen.complaints, "the browser's console has the cause"
    screen.complaints.clear()
