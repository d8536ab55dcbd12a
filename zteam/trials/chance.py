"""What else than the view a behaviour asks: the host's clock and random numbers. Python's profiler tells the calls."""

import random
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

from zteam.behaviors.behavior import Behavior
from zteam.trials.fault import is_authors, place_of_frame

_CLOCKS = {
    *(("time", name) for name in ("time", "time_ns", "monotonic", "monotonic_ns", "sleep")),
    *(("datetime", name) for name in ("now", "utcnow", "today")),
}
"""(module or class, function). `time.perf_counter` only measures."""


class Heard:
    """The calls that were heard: by what was called, the author's line."""

    def __init__(self, kind: type[Behavior]) -> None:
        self._kind = kind
        self.clocks: dict[str, str] = {}
        self.chance: dict[str, str] = {}

    @contextmanager
    def listening(self) -> Iterator[None]:
        """Within, listen to what this thread calls."""
        before = sys.getprofile()
        sys.setprofile(self._take)
        try:
            yield
        finally:
            sys.setprofile(before)

    def _take(self, frame: FrameType, event: str, called: Any) -> None:
        if event != "c_call":
            return
        owner = getattr(called, "__self__", None)
        asked = getattr(owner, "__name__", ""), getattr(called, "__name__", "")
        if isinstance(owner, random.Random):
            self._note(self.chance, "random", frame)
        elif asked in _CLOCKS and is_authors(frame.f_code.co_filename, self._kind):
            # A library such as `logging` may look at the clock.
            self._note(self.clocks, ".".join(asked), frame)

    def _note(self, heard: dict[str, str], name: str, frame: FrameType) -> None:
        if name not in heard:
            heard[name] = place_of_frame(frame, self._kind)
