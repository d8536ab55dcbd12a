"""How long the steps of behaviours and nodes take: those that are too slow, or do not return, are named in the log.

A step keeps its thread, and in lock-step also the bus's thread and the world. So a thread of its own looks at the steps
that are under way.
"""

import logging
import threading
from collections.abc import Callable
from typing import TypeVar

from zteam.clock import Every, monotonic, pause, thread_time
from zteam.node.working import CALLS, WORK, working_for

log = logging.getLogger("zteam")

T = TypeVar("T")

LOOK = 0.25
"""Host seconds between two looks."""
LONG = 1.0
"""Seconds for which a single step is too long: of its thread's processor time, or of looks. A process that is frozen
works no more and looks no more, so it is not blamed."""
SLOW_STEPS = 3
"""So many steps in a row that outlast their interval are the fault of their code; fewer may be the machine's."""
_TELL_EVERY = 60.0

_under_way: set["StepWatch"] = set()
_thread: threading.Thread | None = None


class StepWatch:
    """Watches the steps of one behaviour or node."""

    def __init__(self, step: str, rhythm: str, way_out: str) -> None:
        """The log names `step`, its interval after `rhythm`, such as `a scan comes every`, and the `way_out`."""
        self._step, self._rhythm, self._way_out = step, rhythm, way_out
        self.node = WORK[threading.get_ident()].node
        """Where this process has several: whose steps they are."""
        self._began: float | None = None
        """Host time at which the step began that is under way."""
        self._interval = 0.0
        self._looks = 0
        """How often it was seen under way."""
        self._late = 0
        """How many steps in a row outlasted their interval."""
        self._slow, self._hangs = Every(_TELL_EVERY), Every(_TELL_EVERY)

    @property
    def is_under_way(self) -> bool:
        """Whether a step is under way."""
        return self._began is not None

    @property
    def is_long(self) -> bool:
        """Whether the step under way takes too long."""
        return self._looks * LOOK >= LONG

    def run(self, step: Callable[[], T], interval: float, *, paced: bool) -> T:
        """What `step()` returns. The next step is due after `interval` seconds, 0 where that is not known; where it is
        `paced` by a clock, this step is too slow if it misses the next one.
        """
        self._interval, self._looks = interval, 0
        work = WORK[threading.get_ident()]
        outer_call, work.call = work.call, next(CALLS)
        worked, began = thread_time(), monotonic()
        self._began = began
        _under_way.add(self)
        if _thread is None:
            _start()
        try:
            return step()
        finally:
            _under_way.discard(self)
            work.call = outer_call
            seconds, self._began = monotonic() - began, None
            self._late = self._late + 1 if paced and 0.0 < interval < seconds else 0
            if (self._late >= SLOW_STEPS or self.is_long or thread_time() - worked >= LONG) and self._slow.due():
                log.warning("%s", self._text("takes", seconds))

    def look(self) -> None:
        """The step is under way. Called by the thread that looks."""
        self._looks += 1
        began = self._began
        if began is not None and self.is_long and self._hangs.due():
            with working_for(self.node):
                log.warning("%s", self._text("has not returned for", monotonic() - began))

    def _text(self, verb: str, seconds: float) -> str:
        rhythm = f", {self._rhythm} {self._interval:g} s" if self._interval else ""
        return f"{self._step} {verb} {seconds:.1f} s{rhythm}; {self._way_out}"


def hanging() -> list[StepWatch]:
    """Those whose step is under way and takes too long."""
    return [watch for watch in list(_under_way) if watch.is_long]


def _start() -> None:
    global _thread
    _thread = threading.Thread(target=_look, name="steps", daemon=True)
    _thread.start()


def _look() -> None:
    while True:
        pause(LOOK)
        for watch in list(_under_way):
            watch.look()
