"""The view's process: it may be started and ended at any time, and a team takes no notice."""

import logging
import os
import sys
import webbrowser
from collections.abc import Callable
from pathlib import Path
from typing import Any
from urllib.parse import quote

import msgspec

from zteam.bus.queries import decode_json
from zteam.errors import DecodeError, UsageError
from zteam.node.process_node import ProcessNode
from zteam.node.process_options import ViewOptions
from zteam.view import rights
from zteam.view.server import WebServer, listen
from zteam.view.team_view import TeamView

log = logging.getLogger("zteam")


def run_view(node: ProcessNode, options: ViewOptions, show: Callable[[str], None]) -> None:
    """Serve the page until the process is asked to stop. `show` prints the address, which a log must not have: pages
    without the token show all logs."""
    token, layout = options.token or rights.make_token(), read_layout(options.layout)
    listener, port = listen(options.host, options.port)
    if options.port and port != options.port:
        log.warning("port %d is taken: the view is at port %d", options.port, port)
    if not rights.is_loopback(options.host):
        log.warning(
            "the view listens at %s: every browser that reaches this machine may watch; commands need the token",
            options.host,
        )
    # What it says of each connection is of no use to a user.
    logging.getLogger("uvicorn").setLevel(logging.WARNING)
    state = TeamView(node)
    server = WebServer(state, listener, options.host, token, layout)
    node.on_stop(server.close)
    node.stop.on_request(state.changed)
    server.start()
    node.become_present()
    url = page_url(options.host, port, token)
    show(f"the view is at {url}")
    if options.browser and has_browser():
        webbrowser.open(url)
    state.serve()


def read_layout(path: Path | None) -> bytes:
    """The layout in a file. Raises UsageError."""
    if path is None:
        return b""
    try:
        content = path.read_bytes()
    except OSError as error:
        raise UsageError(f"--layout {path}: {error.strerror or error}") from None
    try:
        layout = decode_json(content, dict[str, Any])
    except DecodeError as error:
        raise UsageError(f"--layout {path}: this is no layout that the page has saved: {error}") from None
    return msgspec.json.encode(layout)


def page_url(host: str, port: int, token: str) -> str:
    """The address of the page, with the token where no server sees it."""
    shown = "127.0.0.1" if host in ("0.0.0.0", "::") else f"[{host}]" if ":" in host else host
    return f"http://{shown}:{port}/#token={quote(token, safe='')}"


def has_browser() -> bool:
    """Whether there is a screen to open a page on: a browser for terminals would take the user's terminal."""
    if sys.platform != "linux":
        return True
    return any(os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER"))
