"""The view's process: it may be started and ended at any time, and a team takes no notice."""

import io
import os
import socket
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any
from urllib.parse import quote, urlsplit

import msgspec

from zteam.bus.transport import decode_json
from zteam.errors import DecodeError, UsageError, log
from zteam.node.launcher import Page, report
from zteam.node.process_node import ProcessNode
from zteam.node.process_options import ViewOptions
from zteam.view.connections import is_loopback, make_token
from zteam.view.foxglove import serve_foxglove, write_layout
from zteam.view.server import WebServer, listen
from zteam.view.team_view import TeamView


def run_view(node: ProcessNode, options: ViewOptions, show: Callable[[str], None]) -> None:
    """Serve the page until the process is asked to stop. `show` prints the address, which a log must not have: pages
    without the token show all logs.
    """
    if options.foxglove_layout is not None:
        write_layout(node, options.foxglove_layout, show)
        return
    token, layout = options.token or make_token(), read_layout(options.layout)
    listener, port = listen(options.host, options.port)
    if options.port and port != options.port:
        log.warning("port %d is taken: the view is at port %d", options.port, port)
    is_open = not options.public_url and not is_loopback(options.host)
    if is_open:
        log.warning(
            "the view listens at %s: every browser that reaches this machine may watch; commands need the token",
            options.host,
        )
    state = TeamView(node)
    server = WebServer(state, listener, options.host, token, layout)
    node.on_stop(server.close)
    node.stop.on_request(state.changed)
    server.start()
    url = page_url(options.public_url or address_of(options.host, port), token)
    show(f"the view is at {url}")
    report(page=Page(port, token))
    if is_open and sys.stdout.isatty():
        show(qr_code(url))
    if options.browser and has_browser():
        open_page(url)
    # It takes a moment, in which the browser loads the page.
    node.become_present()
    if options.foxglove_port is not None:
        serve_foxglove(node, options.host, options.foxglove_port, urlsplit(url).netloc.rpartition(":")[0], show)
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


def page_url(address: str, token: str) -> str:
    """The page at an address, with the token where no server sees it."""
    return f"{address.rstrip('/')}/#token={quote(token, safe='')}"


def address_of(host: str, port: int) -> str:
    """Where browsers find a view that listens at `host`: at this machine's own address if it listens at all."""
    address = own_address() if host in ("0.0.0.0", "::") else host
    return f"http://[{address}]:{port}" if ":" in address else f"http://{address}:{port}"


def own_address() -> str:
    """The address at which others reach this machine; that of loopback where it has no network."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as way:
        try:
            # Nothing is sent: this only chooses the network. The address is one for documentation (RFC 5737).
            way.connect(("192.0.2.1", 9))
        except OSError:
            return "127.0.0.1"
        return str(way.getsockname()[0])


def qr_code(url: str) -> str:
    """The address for the camera of a phone, two rows of dots in each line."""
    import segno

    drawing = io.StringIO()
    segno.make(url, error="l").terminal(drawing, compact=True)
    return drawing.getvalue()


def open_page(url: str) -> None:
    """Open the page in the user's browser, without waiting for it. Out of this terminal: a browser for terminals would
    take it, and what a missing one prints does not belong there."""
    command, nowhere = [sys.executable, "-P", "-m", "webbrowser", url], subprocess.DEVNULL
    apart = {"stdin": nowhere, "stdout": nowhere, "stderr": nowhere, "start_new_session": True}
    threading.Thread(target=subprocess.run, args=(command,), kwargs=apart, name="browser", daemon=True).start()


def has_browser() -> bool:
    """Whether there may be a browser with windows."""
    if sys.platform != "linux":
        return True
    return any(os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER"))
