"""How long steps take, and where the author's code is meanwhile."""

import sys
import threading
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext

from zteam.behaviors.behavior import Behavior
from zteam.clock import monotonic, thread_time
from zteam.trials.chance import Heard
from zteam.trials.fault import Fault, place_of_frame, place_of_step

TICK = 0.1
"""Seconds of processor time that a step may take: a scan of Stage's worlds comes every 0.1 s."""
WAIT = 1.0
"""Seconds of the host's clock that a step may take: on a crowded machine a step waits for the processor."""
SLOW_STEPS = 3
"""So many steps above TICK are the behaviour's fault; a single one may be the machine's."""
HANGS_AFTER = 5.0
"""Seconds after which a step counts as one that does not return."""


class Watch:
    """Watches the thread that steps a behaviour, from another one."""

    def __init__(self, kind: type[Behavior]) -> None:
        self._kind = kind
        self._thread = 0
        self._began: float | None = None
        """When the step began that is under way."""
        self._slow: list[float] = []
        """Seconds of the steps above TICK or WAIT since `slowness` was asked for."""
        self.lost = 0.0
        """Seconds of all of them."""
        self._places: Counter[str] = Counter()
        """Where the author's code was in them, and in how many looks."""
        self.heard: Heard | None = None
        """Takes what steps call; None while none is wanted."""

    @contextmanager
    def step(self) -> Iterator[None]:
        """Within, the behaviour has the thread."""
        self._thread = threading.get_ident()
        began = self._began = monotonic()
        worked = thread_time()
        try:
            with nullcontext() if self.heard is None else self.heard.listening():
                yield
        finally:
            self._began = None
            seconds, worked = monotonic() - began, thread_time() - worked
            if worked > TICK or seconds > WAIT:
                self._slow.append(seconds)
                self.lost += seconds

    def look(self) -> Fault | None:
        """Note where a slow step is; the fault of one that does not return. Called by the other thread."""
        began = self._began
        seconds = 0.0 if began is None else monotonic() - began
        frame = sys._current_frames().get(self._thread) if seconds > TICK else None
        if frame is None or self._began != began:
            return None
        place = place_of_frame(frame, self._kind)
        self._places[place] += 1
        if seconds < HANGS_AFTER:
            return None
        text = f"step did not return within {HANGS_AFTER:g} s"
        return Fault("hangs", text, "do one thing and return: step is called anew for each scan", place)

    def slowness(self) -> Fault | None:
        """The fault of the steps since the last call, if too many were slow."""
        slow, self._slow = self._slow, []
        if len(slow) < SLOW_STEPS:
            return None
        text = f"{len(slow)} steps took longer than a tick of {TICK:g} s, the longest {max(slow):.2f} s"
        hint = "do less in a step, and never sleep: count view.dt until it is time"
        places = [place for place, _looks in self._places.most_common(1)] or [place_of_step(self._kind)]
        return Fault("slow", text, hint, places[0])
