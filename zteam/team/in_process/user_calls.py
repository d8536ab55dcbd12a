"""Whose code runs in a process of a whole team: a call of a user's that does not return is named, and ended; lines of
the log have the name of their node."""

import ctypes
import logging
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import takewhile
from threading import Event, Thread
from traceback import StackSummary, walk_stack
from types import FrameType
from typing import Any, NamedTuple

from zteam import names
from zteam.node.faults import is_own, reading_frames, unreturned_text
from zteam.node.logs import KEEPER, node_of
from zteam.node.step_watch import hanging
from zteam.team.in_process.delivery import Delivery, current_owner
from zteam.team.launch.team_launch import Pace

log = logging.getLogger("zteam")

_PERIOD = 0.5
"""Host seconds between two looks at the threads."""
_DEBUGGERS = ("bdb", "pydevd", "_pydevd")
"""Modules of pdb, and of the debuggers of VS Code and PyCharm."""


def _is_library(frame: FrameType) -> bool:
    return str(frame.f_globals.get("__name__")).partition(".")[0] in sys.stdlib_module_names


def _is_debugger(frame: FrameType) -> bool:
    return str(frame.f_globals.get("__name__")).startswith(_DEBUGGERS)


class _Ended(SystemExit):
    """Raised in a call that does not return. An `except Exception` in its loop does not catch it."""

    def __init__(self) -> None:
        super().__init__(1)


class UserCall(NamedTuple):
    """A call of a node's user code that has not returned."""

    owner: str
    """The node."""
    thread: int
    frames: list[FrameType]
    """From what zteam called to where it is now. The first one is the same object as long as the call lasts."""

    def describe(self) -> str:
        """Which function it is and in which line, and then its traceback."""
        stack = StackSummary.extract((frame, frame.f_lineno) for frame in self.frames)
        return unreturned_text(self.frames[0].f_code.co_qualname, stack)

    def end(self) -> None:
        """End it and its node. One that waits outside of Python, as in `time.sleep`, goes on until that is over."""
        ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(self.thread), ctypes.py_object(_Ended))


def user_calls() -> list[UserCall]:
    """The calls that nodes of this process are in now, without those in a debugger."""
    found = list[UserCall]()
    with reading_frames():
        for thread, top in sys._current_frames().items():
            above = (frame for frame, _ in walk_stack(top))
            frames = [*takewhile(lambda frame: not is_own(frame.f_code.co_filename), above)][::-1]
            owner = current_owner(top, "")
            # What zteam itself calls of the standard library are waits.
            if owner and frames and not _is_library(frames[0]) and not any(map(_is_debugger, frames)):
                found.append(UserCall(owner, thread, frames))
    return found


class CallWatch:
    """Ends the calls that last longer than the time-out of lock-step, in which the other nodes share their thread."""

    def __init__(self, pace: Pace, delivery: Delivery, take: Callable[[UserCall], bool] | None = None) -> None:
        """`take(call)` gets a call that lasts too long, and says whether to end it.

        By default one is ended that holds the world of lock-step. A start may take any time.
        """
        self._pace, self._delivery = pace, delivery
        self._take = take or self._name
        self._named: set[str] = set()
        self._before = {*hanging()}
        """Left behind by another team of this process."""
        self._left_behind = [call.frames[0] for call in user_calls()]
        """As well, and with nodes of perhaps the same names."""

    @property
    def hung(self) -> set[str]:
        """The nodes whose step does not return, or was ended."""
        return self._named.union(watch.node for watch in hanging() if watch not in self._before)

    @contextmanager
    def watching(self) -> Iterator[None]:
        """Within, a thread looks at the calls."""
        ended = Event()
        Thread(target=self._watch, args=(ended,), name="calls", daemon=True).start()
        try:
            yield
        finally:
            ended.set()

    def _watch(self, ended: Event) -> None:
        looks: dict[FrameType, int] = {}
        while not ended.wait(_PERIOD):
            calls = [call for call in user_calls() if call.frames[0] not in self._left_behind]
            # Looks are counted and not seconds: a process that is frozen does not look.
            looks = {call.frames[0]: looks.get(call.frames[0], 0) + 1 for call in calls}
            for call in calls:
                if looks[call.frames[0]] * _PERIOD > self._pace.timeout and self._take(call):
                    call.end()

    def _name(self, call: UserCall) -> bool:
        if not self._pace.lockstep or call.thread != self._delivery.direct:
            return False
        if call.owner not in self._named:
            self._named.add(call.owner)
            with KEEPER.owned_by(call.owner):
                log.error("%s", call.describe())
        return True


@contextmanager
def naming_nodes() -> Iterator[None]:
    """Within, each record of the log has the name of its node as `node`; that of the launcher for all other code."""
    end, before = KEEPER.begin(), KEEPER.owner
    KEEPER.owner = lambda: current_owner(sys._getframe(), names.LAUNCHER)
    try:
        yield
    finally:
        KEEPER.owner = before
        end()


@contextmanager
def prefixing_lines() -> Iterator[None]:
    """Within, the text of each record of a node begins with the node's name: for programs with a log of their own."""
    make = logging.getLogRecordFactory()

    def make_record(*args: Any, **kwargs: Any) -> logging.LogRecord:
        record = make(*args, **kwargs)
        if node_of(record) not in ("", names.LAUNCHER):
            record.msg = f"[{node_of(record)}] {record.msg}"
        return record

    logging.setLogRecordFactory(make_record)
    try:
        yield
    finally:
        if logging.getLogRecordFactory() is make_record:
            logging.setLogRecordFactory(make)
