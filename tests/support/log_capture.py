"""The lines that zteam logs during a test."""

import logging
import threading
from collections.abc import Iterator
from contextlib import contextmanager

from support.limits import LIMIT
from zteam.clock import wait_until


class LogCapture(logging.Handler):
    """Collects the messages of log records, whatever a command has done to zteam's loggers."""

    def __init__(self) -> None:
        super().__init__()
        self.changed = threading.Condition()
        self.lines: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        with self.changed:
            self.lines.append(record.getMessage())
            self.changed.notify_all()

    def wait_for(self, text: str) -> None:
        """Wait for a line that contains `text`."""
        with self.changed:
            assert wait_until(self.changed, lambda: self.count(text) > 0, LIMIT), self.lines

    def count(self, text: str) -> int:
        """The number of lines that contain `text`."""
        return sum(text in line for line in self.lines)


@contextmanager
def captured_log() -> Iterator[LogCapture]:
    """Capture everything from level INFO upwards."""
    handler, root = LogCapture(), logging.getLogger("zteam")
    level = root.level
    root.setLevel(logging.INFO)
    root.addHandler(handler)
    try:
        yield handler
    finally:
        root.removeHandler(handler)
        root.setLevel(level)
