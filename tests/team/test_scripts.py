"""Scripts that end without closing their bus."""

import os
import subprocess
import sys
from collections.abc import Iterator

import pytest

from support.limits import LIMIT
from zteam.team.testing.team import TeamFixture

pytestmark = pytest.mark.team

OPEN = """
from zteam.bus import BusOptions, NoRequest, connect
from zteam.messages import Bool
bus = connect(BusOptions.from_environment())
"""
DECLARE = """
bus.subscribe("flag", Bool, print, latched=True)
bus.serve("box/count", NoRequest, print)
bus.watch_tokens(["*/alive/*"], lambda *_: None)
bus.publisher("flag", Bool, latched=True).put(Bool(True))
"""
NODE = """
import sys, zteam
def body(node):
    node.subscribe("flag", Bool, print)
    {}
from zteam.messages import Bool
zteam.run("box", body)
"""
THREAD = f"""
import threading
heard = threading.Event()
bus.subscribe("flag", Bool, lambda *_: heard.set())
def work():
    threading.main_thread().join()
    bus.publisher("flag", Bool).put(Bool(True))
    print("heard", heard.wait({LIMIT}))
threading.Thread(target=work).start()
"""


@pytest.fixture(scope="module")
def router() -> Iterator[dict[str, str]]:
    """The environment of commands at a router without a team."""
    team = TeamFixture()
    yield team.environment
    team.close()


@pytest.mark.parametrize(
    ("script", "code", "text"),
    [
        (OPEN, 0, ""),
        (OPEN + DECLARE, 0, ""),
        (OPEN + DECLARE + "1 / 0", 1, "ZeroDivisionError: division by zero"),
        (OPEN + DECLARE + "raise SystemExit(3)", 3, ""),
        (OPEN + DECLARE + "raise KeyboardInterrupt", 130, "KeyboardInterrupt"),
        (OPEN + DECLARE + "bus.close(); bus.close()", 0, ""),
        (NODE.format("1 / 0"), 1, "ZeroDivisionError: division by zero"),
        (NODE.format("sys.exit(3)"), 3, ""),
        (OPEN + THREAD, 0, "heard True"),
    ],
)
def test_a_script_ends_by_itself(router: dict[str, str], script: str, code: int, text: str) -> None:
    """Without `bus.close()` a script ends with its exit code or its exception, after its threads have finished."""
    done = subprocess.run(
        [sys.executable, "-c", script],
        env={**os.environ, **router},
        capture_output=True,
        text=True,
        timeout=LIMIT,
        check=False,
    )
    # The interpreter's own code for an uncaught KeyboardInterrupt is the signal.
    assert done.returncode in ((130, -2) if code == 130 else (code,)), done.stderr
    assert text in done.stdout + done.stderr
    assert "ignored" not in done.stderr
