"""Calls of a user's code that do not return, in the process of a whole team: they are named and ended."""

import ctypes
import logging
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Event, Thread

from zteam.node.faults import dump_stacks, unreturned_calls
from zteam.node.step_watch import hanging
from zteam.node.working import WORK, working_for
from zteam.team.launch.team_launch import Pace

log = logging.getLogger("zteam")

_PERIOD = 0.5
"""Host seconds between two looks at the threads."""

_UNSEEN = "a call has not returned (faulthandler shows no more than 100 threads)"

Call = tuple[int, str]
"""The number of a call that is under way, and its node."""


class _Ended(SystemExit):
    """Raised in a call that does not return. An `except Exception` in its loop does not catch it."""

    code = 1


def end_call(thread: int) -> None:
    """End what a thread runs, such as an endless loop of a user's code, and the node that runs there.

    This is a hack. Python offers no way to end a thread; CPython's C API can only have the thread raise an exception
    at its next bytecode, wherever that is. So it can leave data half changed, and code that catches SystemExit goes
    on. A thread that waits outside of Python, as in `time.sleep`, raises when the wait is over. It is used only on a
    node that hangs: without it, one such loop takes the interpreter's lock from all that follows in the process, such
    as the rest of a pytest session.
    """
    ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(thread), ctypes.py_object(_Ended))


def end_user_calls() -> None:
    """End every node of this process that is in a user's code now."""
    for thread in unreturned_calls(dump_stacks()):
        if WORK[thread].node:
            end_call(thread)


class CallWatch:
    """Ends the calls of nodes that last longer than the time-out of lock-step, in which other nodes wait for them."""

    def __init__(self, pace: Pace, take: Callable[[str, str], None] | None = None) -> None:
        """`take(node, text)` gets a call that lasts too long. By default it is logged, and out of lock-step such calls
        go on."""
        self._timeout = pace.timeout
        self._take = take or (self._log if pace.lockstep else None)
        self.hangs: dict[str, str] = {}
        """Where the nodes were whose calls were ended, by name."""
        self._before = {*hanging()}
        """Left behind by another team of this process."""
        self._calls_before = self._calls()
        """As well, and of nodes of perhaps the same names."""

    @property
    def hung(self) -> set[str]:
        """The nodes whose step does not return, or was ended."""
        return {*self.hangs, *(watch.node for watch in hanging() if watch not in self._before)}

    def _calls(self) -> dict[Call, int]:
        """The calls that others wait for now, those of other teams too, and their threads."""
        return {(work.call, work.node): thread for thread, work in WORK.copy().items() if work.node and work.call}

    @contextmanager
    def watching(self) -> Iterator[None]:
        """Within, a thread looks at the calls."""
        ended = Event()
        if self._take is not None:
            Thread(target=self._watch, args=(ended, self._take), name="calls", daemon=True).start()
        try:
            yield
        finally:
            ended.set()

    def _watch(self, ended: Event, take: Callable[[str, str], None]) -> None:
        looks = Counter[Call]()
        while not ended.wait(_PERIOD):
            # Looks are counted and not seconds: a process that is frozen does not look.
            looks = Counter({call: looks[call] + 1 for call in self._calls() if call not in self._calls_before})
            late = {call for call in looks if looks[call] * _PERIOD > self._timeout}
            dump = dump_stacks() if late else ""
            found = unreturned_calls(dump)
            for call, thread in self._calls().items():
                text = found.get(thread) or ("" if f"{thread:x}" in dump else _UNSEEN)
                if call in late and text:
                    node = call[1]
                    if node not in self.hangs:
                        self.hangs[node] = f"{node} hangs: after {self._timeout:g} s {text}"
                        take(node, self.hangs[node])
                    end_call(thread)

    def _log(self, node: str, text: str) -> None:
        with working_for(node):
            log.error("%s", text)
