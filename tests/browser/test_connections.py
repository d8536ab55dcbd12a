"""Which pages reach the view: those of its own address, also on all interfaces, and no page of another site."""

import re
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from urllib.parse import urlsplit

from support.browser import VIEW, Screen, start_view
from support.terminal import TerminalCommand
from zteam.team.launch.process import zteam_command
from zteam.team.testing.team import TeamFixture
from zteam.view.node import qr_code

OPEN = """url => new Promise((resolve) => {
  const socket = new WebSocket(url);
  socket.onopen = () => resolve('open');
  socket.onclose = () => resolve('closed');
})"""
"""How a socket to this address ends."""


class OtherPage(BaseHTTPRequestHandler):
    """A page without content."""

    def do_GET(self) -> None:
        """Answer with it."""
        self.send_response(200)
        self.send_header("Content-Length", "0")
        self.end_headers()

    def log_message(self, *_: object) -> None:
        """Say nothing."""


@contextmanager
def other_site() -> Iterator[str]:
    """The origin of another site, which is on this machine too: a browser lets no page of elsewhere try."""
    with ThreadingHTTPServer(("127.0.0.1", 0), OtherPage) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        try:
            yield f"http://127.0.0.1:{server.server_port}"
        finally:
            server.shutdown()


def test_a_page_of_another_site_opens_no_socket_and_one_line_says_so(team: TeamFixture, screen: Screen) -> None:
    """The browser's socket is closed before it opens; one line is all that the view says of it until its end."""
    team.start("arena", 1, behavior="idle", lockstep=False)
    page = start_view(team).partition("#")[0]
    known = len(team.lines(VIEW))
    with other_site() as origin:
        screen.page.goto(origin)
        assert screen.ask(OPEN, f"{page.replace('http', 'ws')}ws") == "closed"
    assert team.stop(VIEW) == 0
    # A crowded machine may give reasons to warn.
    [line] = [line for line in team.lines(VIEW)[known:] if " warning: " not in line]
    assert line.endswith(f"a socket is refused: a page of '{origin}' may not open it")


def address_in(rows: list[str]) -> str:
    """The address that a terminal shows, if its QR code is there too."""
    text = "\n".join(rows)
    found = re.search(r"the view is at (http://\S+#token=\S+)", text)
    if found is None:
        return ""
    code = re.sub(r"\x1b\[[0-9;]*m", "", qr_code(found[1])).rstrip()
    return found[1] if "\n".join(line.rstrip() for line in code.splitlines()) in text else ""


def test_a_view_on_all_interfaces_is_found_and_commanded(team: TeamFixture, screen: Screen) -> None:
    """Its terminal shows an address with the token, and that as a QR code; a page under another address of the machine
    may command with this token."""
    team.start("arena", 1, behavior="idle", lockstep=False)
    arguments = ("--no-browser", "--port", "0", "--host", "0.0.0.0", "--name", VIEW)
    terminal = TerminalCommand(zteam_command("zteam-view", *arguments), team.environment)
    try:
        url = urlsplit(address_in(terminal.wait_for(lambda rows: address_in(rows) != "")))
        assert url.hostname != "0.0.0.0"
        # Not under the address that it shows: the test's messages stay on this machine.
        screen.open(url._replace(netloc=f"127.0.0.2:{url.port}").geturl(), 1)
        screen.wait("zteam.app.store.connection.mayCommand")
        assert screen.ask("zteam.app.send({op: 'pause'})") == ""
        team.wait_for(lambda: team.sim_status.paused)
    finally:
        terminal.close()
