"""Logging of every process: one line an event, as text for people or as JSON for machines, on stderr."""

import logging
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import msgspec

from zteam.clock import local_time_text, wall_ns
from zteam.runtime.log_keeper import KEEPER

LEVELS = ("debug", "info", "warning", "error")


def node_of(record: logging.LogRecord) -> str:
    """The node whose line it is, where this process has several; else empty."""
    return getattr(record, "node", "")


class _Text(logging.Formatter):
    def __init__(self, name: str) -> None:
        super().__init__()
        self._name = name

    def format(self, record: logging.LogRecord) -> str:
        level = "" if record.levelno == logging.INFO else f"{record.levelname.lower()}: "
        text = f"{local_time_text()} [{node_of(record) or self._name}] {level}{record.getMessage()}"
        return f"{text}\n{self.formatException(record.exc_info)}" if record.exc_info else text


class _Json(logging.Formatter):
    def __init__(self, name: str) -> None:
        super().__init__()
        self._name = name

    def format(self, record: logging.LogRecord) -> str:
        entry = {
            "time_ns": wall_ns(),
            "process": node_of(record) or self._name,
            "level": record.levelname.lower(),
            "text": record.getMessage(),
        }
        if record.exc_info:
            entry["exception"] = self.formatException(record.exc_info)
        return msgspec.json.encode(entry).decode()


class _Stderr(logging.Handler):
    """Writes to whatever is stderr at the time: the live table redirects it, so that lines scroll by above."""

    def emit(self, record: logging.LogRecord) -> None:
        try:
            sys.stderr.write(self.format(record) + "\n")
            sys.stderr.flush()
        except Exception:
            self.handleError(record)


def start_logging(name: str, level: str = "info", form: str = "text") -> None:
    """Send the log of zteam and of a user's modules to stderr under the process's name, and begin to keep its lines."""
    handler = _Stderr()
    handler.setFormatter(_Json(name) if form == "json" else _Text(name))
    own, everything = logging.getLogger("zteam"), logging.getLogger()
    own.handlers[:] = [handler]
    own.propagate = False
    everything.handlers[:] = [*(other for other in everything.handlers if not isinstance(other, _Stderr)), handler]
    for logger in (own, everything):
        logger.setLevel(level.upper())
    # Its debug lines are thousands.
    logging.getLogger("PIL").setLevel(logging.WARNING)
    KEEPER.begin()


class _Lines(logging.Handler):
    """Passes on the lines of the nodes in this process; those of the process itself go where they went before."""

    def __init__(self, write: Callable[[str, str], None], before: logging.Handler, own: str) -> None:
        super().__init__()
        self._write, self._before, self._own = write, before, own
        self.formatter = before.formatter

    def emit(self, record: logging.LogRecord) -> None:
        node = node_of(record)
        if node in ("", self._own):
            self._before.emit(record)
            return
        try:
            self._write(node, self.format(record))
        except Exception:
            self.handleError(record)


@contextmanager
def passing_lines(write: Callable[[str, str], None], own: str) -> Iterator[None]:
    """Within, `write(node, text)` gets the lines of the nodes in this process, which is called `own`."""
    loggers = [logging.getLogger("zteam"), logging.getLogger()]
    before = [logger.handlers[:] for logger in loggers]
    for logger in loggers:
        logger.handlers[:] = [_Lines(write, h, own) if isinstance(h, _Stderr) else h for h in logger.handlers]
    try:
        yield
    finally:
        for logger, handlers in zip(loggers, before, strict=True):
            logger.handlers[:] = handlers
