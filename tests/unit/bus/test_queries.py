"""What a query's text becomes."""

import subprocess
import sys

import pytest

from support.limits import LIMIT

FIRST_USES = """
import sys, threading
from msgspec import defstruct
from zteam.bus.transport import decode_json

def decode():
    together.wait()
    decode_json(b'{"a": {"b": [1]}, "z": {"b": [2]}}', outer)

sys.setswitchinterval(1e-6)
for number in range(100):
    fields = [(name, list[int] | None, None) for name in "bcdefghi"]
    inner = [(name, defstruct(name * 2, fields) | None, None) for name in "axyz"]
    outer, together = defstruct("Outer", inner), threading.Barrier(4)
    threads = [threading.Thread(target=decode) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
"""


@pytest.mark.gate
def test_threads_may_use_a_type_for_the_first_time_at_once() -> None:
    """As the nodes of a team in one process do; msgspec alone crashes."""
    ended = subprocess.run([sys.executable, "-c", FIRST_USES], check=False, capture_output=True, timeout=LIMIT)
    assert ended.returncode == 0, ended.stderr
