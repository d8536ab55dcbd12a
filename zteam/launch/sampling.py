"""Calls a function now and then until it is closed."""

import threading
from collections.abc import Callable


class Sampler:
    """Calls `sample()` every `period` host seconds, on a thread of its own."""

    def __init__(self, sample: Callable[[], None], period: float) -> None:
        self._sample, self._period = sample, period
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="usage", daemon=True)
        self._thread.start()

    def _run(self) -> None:
        while not self._closing.wait(self._period):
            self._sample()

    def close(self, patience: float) -> None:
        """End, and wait at most `patience` host seconds for a call that has begun."""
        self._closing.set()
        self._thread.join(patience)
