"""Calls of a user's code that do not return, in the process of a whole team: they are named and ended."""

import ctypes
import logging
from collections.abc import Callable
from threading import Event, Thread

from zteam.node.faults import dump_stacks, unreturned_calls
from zteam.node.working import WORK, hanging, working_for
from zteam.team.launch.plan import Pace

log = logging.getLogger("zteam")

_PERIOD = 0.5
"""Host seconds between two looks at the threads."""

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

    def __init__(self, pace: Pace, *, in_real_time: bool) -> None:
        """Out of lock-step such calls go on, unless they are to end `in_real_time` too."""
        self._ends_calls = pace.lockstep or in_real_time
        self._timeout = pace.timeout
        self.hangs: dict[str, str] = {}
        """The nodes whose calls lasted too long, and where they were then, in words."""
        self._before = {*hanging()}
        """Left behind by an earlier team of this process."""
        self._calls_before = self._calls()
        """As well, and of nodes of perhaps the same names."""

    @property
    def hung(self) -> set[str]:
        """The nodes whose step does not return, or was ended."""
        return {*self.hangs, *(watch.node for watch in hanging() if watch not in self._before)}

    def _calls(self) -> dict[Call, int]:
        """The calls that others wait for now, those of other teams too, and their threads."""
        return {(work.call, work.node): thread for thread, work in WORK.copy().items() if work.node and work.call}

    def start(self) -> Callable[[], None]:
        """Have a thread look at the calls; returns a function that ends this."""
        ended = Event()
        if self._ends_calls:
            Thread(target=self._watch, args=(ended,), name="calls", daemon=True).start()
        return ended.set

    def _watch(self, ended: Event) -> None:
        looks = dict[Call, int]()
        while not ended.wait(_PERIOD):
            calls = {call: thread for call, thread in self._calls().items() if call not in self._calls_before}
            # Only calls that were seen before last long enough to be shown.
            shown = unreturned_calls(dump_stacks() if looks.keys() & calls.keys() else "")
            # Looks are counted and not seconds: a frozen process does not look, and the time in a debugger is left out.
            looks = {
                call: looks.get(call, 0) + 1 for call, thread in calls.items() if call not in looks or thread in shown
            }
            for call, count in looks.items():
                if count * _PERIOD > self._timeout and calls[call] in shown:
                    self._name(call[1], shown[calls[call]])
                    if call in self._calls():
                        end_call(calls[call])

    def _name(self, node: str, text: str) -> None:
        if node not in self.hangs:
            self.hangs[node] = f"{node} hangs: after {self._timeout:g} s {text}"
            with working_for(node):
                log.error("%s", self.hangs[node])
