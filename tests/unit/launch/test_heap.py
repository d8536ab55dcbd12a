"""A heap without gaps."""

import subprocess
import sys

import pytest

from zteam.launch.heap import fill_gaps, free_below_end

TEXT = """
import ctypes
from zteam.launch.heap import fill_gaps, free_below_end

library = ctypes.CDLL(None)
library.malloc.restype, library.free.argtypes = ctypes.c_void_p, [ctypes.c_void_p]
places = [library.malloc(size) for size in (40, 700, 9000) for _ in range(100)]
# Each second one: a gap between two that are in use.
for place in places[::2]:
    library.free(place)
before = free_below_end()
fill_gaps()
print(before, free_below_end())
"""


@pytest.mark.skipif(free_below_end() is None, reason="this C library does not tell")
def test_all_gaps_are_filled() -> None:
    """What was freed between what is in use is taken: further memory comes from the end of the heap."""
    # A process of its own: here other threads use the heap.
    ended = subprocess.run([sys.executable, "-c", TEXT], capture_output=True, text=True, check=True)
    before, after = map(int, ended.stdout.split())
    assert before > 40 * 9000
    assert after < 1000


def test_the_filled_heap_still_serves() -> None:
    """All sizes can be had afterwards."""
    fill_gaps()
    assert [len(bytes(size)) for size in (600, 10_000, 1_000_000)] == [600, 10_000, 1_000_000]
