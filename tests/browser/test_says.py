"""What the page says: that the world stands, that it only watches, where the team is, what has not come yet."""

from urllib.parse import urlsplit

from support.browser import VIEW, OpenScreen, Screen, show, start_view
from zteam.team.testing.team import TeamFixture

TOKEN = "kept-by-this-browser"
KEPT = "localStorage.getItem('zteam-token:' + zteam.app.store.team.namespace)"
SPEED = "Number(document.querySelector('#robots td.number').textContent)"
BANNER = "form[aria-label='Right to command']"


def text_of(screen: Screen, selector: str) -> str:
    """What an element shows."""
    return str(screen.ask("selector => document.querySelector(selector).textContent", selector))


def wait_for_text(screen: Screen, selector: str, text: str) -> None:
    """Wait until an element shows this text."""
    screen.wait("([selector, text]) => document.querySelector(selector)?.textContent.includes(text)", [selector, text])


def test_a_world_that_stands_says_so_on_the_map(team: TeamFixture, screen: Screen) -> None:
    """PAUSED stands on the map, and there are neither a real-time factor nor a robot's speed until the world goes on;
    the namespace is named."""
    show(team, screen, 1, behavior="wander")
    factor = "#sim .value[title^=Real]"
    screen.wait("zteam.app.store.team.sim.state === 'running'")
    wait_for_text(screen, factor, "×")
    screen.wait(f"{SPEED} > 0")
    assert text_of(screen, "#stands") == ""
    screen.page.click("button[aria-label=Pause]")
    wait_for_text(screen, "#stands", "PAUSED")
    assert text_of(screen, factor) == "–"
    wait_for_text(screen, "#robots td.number", "–")
    screen.page.click("#tab-simulator")
    wait_for_text(screen, "#page-simulator .facts", f"Namespace{team.namespace}")
    assert "Real-time factor–" in text_of(screen, "#page-simulator .facts")
    screen.page.click("button[aria-label=Resume]")
    screen.wait("document.querySelector('#stands').textContent === ''")
    wait_for_text(screen, factor, "×")
    screen.page.click("#tab-team")
    screen.wait(f"{SPEED} > 0")


def test_a_page_that_watches_takes_a_token_and_keeps_it(team: TeamFixture, open_screen: OpenScreen) -> None:
    """A wrong token is called wrong; with the right one the page commands, also after it was loaded again and in
    another tab, until the view has another token: then it is forgotten."""
    team.start("arena", robots=1, behavior="idle", lockstep=False)
    url = start_view(team, "--token", TOKEN)
    page, port = url.partition("#")[0], urlsplit(url).port or 0
    screen = open_screen()
    screen.open(page, 1)
    screen.page.wait_for_selector(f"{BANNER} >> text=Watching only")
    screen.page.fill("input[aria-label=Token]", "guessed")
    screen.page.keyboard.press("Enter")
    wait_for_text(screen, BANNER, "not the token of this view")
    assert screen.ask(KEPT) is None
    screen.page.fill("input[aria-label=Token]", url)
    screen.page.keyboard.press("Enter")
    screen.wait("zteam.app.store.connection.mayCommand")
    assert not screen.page.is_visible(BANNER)
    assert screen.ask(KEPT) == TOKEN
    assert TOKEN not in screen.page.url
    tab = Screen(screen.page.context.new_page())
    tab.open(page, 1)
    tab.wait("zteam.app.store.connection.mayCommand")
    assert tab.ask("zteam.app.send({op: 'pause'})") == ""
    team.wait_for(lambda: team.sim_status.paused)
    tab.page.close()
    team.kill(VIEW)
    screen.wait("zteam.app.store.connection.state === 'lost'")
    start_view(team, "--token", "another one", port=port)
    wait_for_text(screen, BANNER, "not the token of this view")
    assert not screen.ask("zteam.app.store.connection.mayCommand")
    assert screen.ask(KEPT) is None
    screen.page.click(f"{BANNER} button[aria-label='Only watch']")
    assert not screen.page.is_visible(BANNER)
    screen.page.click("#status >> text=watching only")
    screen.page.wait_for_selector(BANNER)


def test_a_browser_that_keeps_nothing_commands_too(team: TeamFixture, screen: Screen) -> None:
    """The address with the token may be entered where the page is open; the token leaves the address at once."""
    team.start("arena", robots=1, behavior="idle", lockstep=False)
    url = start_view(team)
    refuses = "get() { throw new DOMException('not allowed', 'SecurityError'); }"
    screen.page.add_init_script(f"Object.defineProperty(window, 'localStorage', {{ {refuses} }})")
    screen.open(url.partition("#")[0], 1)
    screen.page.wait_for_selector(f"{BANNER} >> text=Watching only")
    screen.page.goto(url)
    screen.wait("zteam.app.store.connection.mayCommand")
    assert "token" not in screen.page.url


def test_tables_say_that_nothing_has_come_yet(team: TeamFixture, screen: Screen) -> None:
    """Before the first frame no table reads as if it were empty; afterwards they have rows."""
    held: list[str | bytes] = []
    release: list[object] = []

    def between(socket: object) -> None:
        server = socket.connect_to_server()  # type: ignore[attr-defined]
        release.append(lambda: [socket.send(held.pop(0)) for _ in list(held)])  # type: ignore[attr-defined]

        def take(message: str | bytes) -> None:
            if isinstance(message, str) or len(release) > 1:
                socket.send(message)  # type: ignore[attr-defined]
            else:
                held.append(message)

        server.on_message(take)

    team.start("arena", robots=1, behavior="idle", lockstep=False)
    url = start_view(team)
    screen.page.route_web_socket("**/ws", between)
    screen.page.goto(url)
    screen.wait("window.zteam?.app.store.connection.state === 'open'")
    for tab, text in (
        ("team", "Loading the robots"),
        ("topics", "Loading the topics"),
        ("frames", "Loading the frames"),
    ):
        screen.page.click(f"#tab-{tab}")
        wait_for_text(screen, f"#page-{tab} .hint:not([hidden])", text)
    screen.page.click("#tab-simulator")
    wait_for_text(screen, "#page-simulator .facts", "loading")
    screen.page.click("#tab-log")
    wait_for_text(screen, "#page-log .hint", "Loading the log")
    release.append(None)
    release[0]()  # type: ignore[operator]
    for tab, row in (("team", "#robots tbody"), ("topics", "#topics tbody"), ("frames", "#frames tbody")):
        screen.page.click(f"#tab-{tab}")
        screen.page.wait_for_selector(row)
    screen.page.wait_for_selector("#page-log .line")


def test_a_browser_without_webgl_has_the_tables(team: TeamFixture, screen: Screen) -> None:
    """In place of the map the page says what is missing and names the way out; team, topics, frames and log work."""
    screen.page.add_init_script("""
      const getContext = HTMLCanvasElement.prototype.getContext;
      HTMLCanvasElement.prototype.getContext = function (kind, ...rest) {
        return kind === 'webgl2' ? null : getContext.call(this, kind, ...rest);
      };
    """)
    team.start("arena", 1, behavior="idle", lockstep=False)
    screen.open(start_view(team), 1)
    screen.page.wait_for_selector("#no-map h1:has-text('no WebGL2')")
    assert "graphics acceleration" in text_of(screen, "#no-map")
    for name, row in (("Team", "#robots"), ("Topics", "#topics"), ("Frames", "#frames"), ("Log", "#page-log .line")):
        screen.page.click(f"#no-map button:text-is('{name}')")
        screen.page.wait_for_selector(f"{row} tbody" if row != "#page-log .line" else row)
    screen.page.click("button[aria-label=Pause]")
    team.wait_for(lambda: team.sim_status.paused)
