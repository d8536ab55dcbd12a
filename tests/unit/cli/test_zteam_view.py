"""`zteam view` and `zteam up --view`: their options, and what they print."""

import ipaddress
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from support.limits import LIMIT
from zteam.cli import processes
from zteam.errors import UsageError
from zteam.node.process_options import ViewOptions
from zteam.view.node import address_of, has_browser, open_page, own_address, page_url, qr_code, read_layout
from zteam.view.server import listen


def test_a_taken_port_leads_to_another_one() -> None:
    """The next one that is free is taken."""
    first, port = listen("127.0.0.1", 0)
    second, other = listen("127.0.0.1", port)
    with first, second:
        assert other != port


def test_an_address_of_another_machine_is_refused() -> None:
    """The error names the option."""
    with pytest.raises(UsageError, match=r"192\.0\.2\.1"):
        listen("192.0.2.1", 0)


def test_the_address_has_the_token_in_its_fragment() -> None:
    """A browser sends it to no server; the page of a server for the whole network is opened on this machine."""
    assert page_url(address_of("127.0.0.1", 8765), "a b") == "http://127.0.0.1:8765/#token=a%20b"
    assert page_url(address_of("0.0.0.0", 1), "t") == f"http://{own_address()}:1/#token=t"
    assert ipaddress.ip_address(own_address()).version == 4
    assert page_url(address_of("::1", 1), "t") == "http://[::1]:1/#token=t"


def test_the_environment_says_where_a_page_is(monkeypatch: pytest.MonkeyPatch) -> None:
    """For views of containers, which `zteam up` starts too; without it a view is on loopback."""
    for name in ("HOST", "TOKEN", "URL"):
        monkeypatch.delenv(f"ZTEAM_VIEW_{name}", raising=False)
    assert ViewOptions.from_environment() == ViewOptions()
    monkeypatch.setenv("ZTEAM_VIEW_HOST", "0.0.0.0")
    monkeypatch.setenv("ZTEAM_VIEW_URL", "http://localhost:9000/")
    options = ViewOptions.from_environment()
    assert options == ViewOptions("0.0.0.0", public_url="http://localhost:9000/")
    assert page_url(options.public_url, "t") == "http://localhost:9000/#token=t"


def test_a_browser_needs_a_screen(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without one there is nothing to open a page with."""
    monkeypatch.setattr(sys, "platform", "linux")
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER"):
        monkeypatch.delenv(name, raising=False)
    assert not has_browser()
    monkeypatch.setenv("DISPLAY", ":0")
    assert has_browser()


def test_a_browser_opens_the_page_out_of_the_terminal(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """It gets the address, and neither the terminal nor a place to print; who opens the page does not wait for it."""
    browser, told, ends = tmp_path / "browser", tmp_path / "told", tmp_path / "ends"
    os.mkfifo(told)
    os.mkfifo(ends)
    browser.write_text(
        f'#!/bin/sh\n(echo "$1"; readlink /proc/self/fd/0; tty </dev/tty) >{told} 2>&1\nread _ <{ends}\n'
    )
    browser.chmod(0o755)
    monkeypatch.setenv("BROWSER", str(browser))
    open_page("http://127.0.0.1:1/#token=t")
    address, standard_input, *terminal = told.read_text().splitlines()
    assert (address, standard_input) == ("http://127.0.0.1:1/#token=t", "/dev/null")
    assert not any(line.startswith("/dev/") for line in terminal)
    ends.write_text("\n")


def test_a_layout_is_checked_before_anything_starts(tmp_path: Path) -> None:
    """A file that is missing, or holds something else, is named."""
    path = tmp_path / "layout.json"
    with pytest.raises(UsageError, match="No such file"):
        read_layout(path)
    path.write_text("[1]")
    with pytest.raises(UsageError, match="no layout"):
        read_layout(path)
    path.write_text('{"theme": "dark"}')
    assert (read_layout(path), read_layout(None)) == (b'{"theme":"dark"}', b"")


@pytest.mark.gate
def test_a_robots_process_imports_no_web_server() -> None:
    """Neither does a simulator."""
    code = (
        "import sys, zteam.cli.processes, zteam.robot.process.node, zteam.simulator.process.node\n"
        "import zteam.team.run.processes, zteam.team.run.team_run\n"
        "print(sorted({'starlette', 'uvicorn', 'websockets', 'asyncio'} & sys.modules.keys()))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=LIMIT)
    assert done.stdout.strip() == "[]"


def test_a_phone_reads_the_address() -> None:
    """The drawing for a terminal is square, and a longer address needs a larger one."""
    short, long = (
        qr_code(f"http://192.0.2.1:8765/#token={'x' * length}").strip("\n").splitlines() for length in (8, 90)
    )
    assert 10 < len(short) < len(long) < 40
    assert len({len(re.sub(r"\x1b\[[0-9;]*m", "", line)) for line in short}) == 1


def test_foxglove_needs_its_package(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """Without it one line says how to get it, before anything is started."""
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    assert processes.main("zteam-view", ["--foxglove", "--no-browser"]) == 2
    assert capsys.readouterr().err.splitlines() == [
        "view: --foxglove needs the package foxglove-sdk: pip install 'zteam[foxglove]'"
    ]
