"""Commands that the system gives too little memory."""

import subprocess
import sys

import pytest

from support.limits import LIMIT

SHORT = """
import resource, sys, threading
from pathlib import Path
from zteam.bus import connect
from zteam.cli import {module}
used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (used + {room}, used + {room}))
sys.exit({module}.main(*{arguments}))
"""


@pytest.mark.ci
@pytest.mark.skipif(sys.platform != "linux", reason="the limit counts from what /proc says is used")
@pytest.mark.parametrize(
    ("module", "arguments"), [("processes", ["zteam-sim", ["arena"]]), ("up", [["line", "--in-process"]])]
)
def test_too_little_memory_is_told_on_one_line(module: str, arguments: list[object]) -> None:
    """A command with room for few allocations or for no thread ends with 1 and a line that names limits."""
    code = SHORT.format(module=module, room=12_000_000, arguments=arguments)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=LIMIT, check=False)
    assert done.returncode == 1, done.stderr
    assert "Traceback (most recent call last)" not in done.stderr
    assert done.stderr.splitlines()[-1].count("the system gives no more memory") == 1
    assert "ulimit -v" in done.stderr
