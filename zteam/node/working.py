"""Which node each thread of this process works for, where a process has several, and which call is under way there."""

from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import count
from threading import get_ident


class Work:
    """What one thread does. Only that thread changes it."""

    __slots__ = ("call", "node")

    def __init__(self) -> None:
        self.node = ""
        """Empty for code of no node."""
        self.call = 0
        """The number of the call under way that others wait for, such as a step; 0 between two calls."""


WORK: defaultdict[int, Work] = defaultdict(Work)
"""By thread. A later thread may get the number of one that has ended, and its idle Work."""
CALLS = count(1)
"""Numbers of calls: each call has its own."""


@contextmanager
def working_for(node: str) -> Iterator[None]:
    """Within, this thread works for `node`."""
    work = WORK[get_ident()]
    before, work.node = work.node, node
    try:
        yield
    finally:
        work.node = before
