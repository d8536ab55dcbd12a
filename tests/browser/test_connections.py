"""How a page reaches the view under another address of its machine."""

import re
from urllib.parse import urlsplit

from support.browser import VIEW, Screen
from support.terminal import TerminalCommand
from zteam.team.launch.process import zteam_command
from zteam.team.testing.team import TeamFixture
from zteam.view.node import qr_code


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
