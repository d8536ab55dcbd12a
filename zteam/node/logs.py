"""The log of a process: one line an event on stderr, as text for people or as JSON, and the newest lines kept."""

import logging
import os
import sys
import threading
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import Annotated, Any

import msgspec

from zteam.clock import local_time_text, wall_ns
from zteam.errors import printable, printable_json
from zteam.node.working import WORK

LEVELS = ("debug", "info", "warning", "error")
KEPT = 200
"""Lines that a process keeps for the query of its log."""
MAX_TEXT = 8192
"""Characters of a line's text that are kept."""
LONGEST = 16_384
"""Characters of a line that are read: a sender of another kind may cut none."""


class LogLine(msgspec.Struct, frozen=True):
    """One line of a process's log. `<name>/log` answers with a list of these; a process logs no two equal ones."""

    time_ns: Annotated[int, msgspec.Meta(ge=-(2**63), le=2**63 - 1)]
    """The clock of the process's host, since the Unix epoch."""
    process: str
    level: Annotated[int, msgspec.Meta(ge=0, le=255)]
    """As in Python and in ROS 2 (zteam.messages.LogLevel)."""
    text: str
    file: str = ""
    function: str = ""
    line: int = 0

    def cut(self) -> "LogLine":
        """The same with no text beyond LONGEST characters."""
        if max(map(len, (self.text, self.file, self.function))) <= LONGEST:
            return self
        text = self.text if len(self.text) <= LONGEST else f"{self.text[:LONGEST]}… (the line is longer)"
        return msgspec.structs.replace(self, text=text, file=self.file[:LONGEST], function=self.function[:LONGEST])


Sink = Callable[[LogLine], None]
RecordFactory = Callable[..., logging.LogRecord]


class LogKeeper:
    """Keeps the newest KEPT lines and passes each new one on. Thread-safe; it never raises in a call that logs.

    Lines are taken where Python makes its log records (`logging.setLogRecordFactory`), not by a handler: a handler at
    the root of a user's program would switch off `logging.basicConfig` and Python's own output of warnings, and would
    miss loggers that do not propagate.
    """

    def __init__(self) -> None:
        self._users = 0
        """Begins without their ends."""
        self._run: object = None
        """What marks the time from the first begin to the last end; None between two of these."""
        self._thread = threading.local()
        self._kept: deque[LogLine] = deque(maxlen=KEPT)
        self._last = 0
        self._others, self._prefix = "", False
        """What `naming_nodes` was given."""
        self.reset()

    def reset(self) -> None:
        """Forget the sinks, and the lock: a forked child has neither its parent's session nor its threads."""
        # Reentrant: the garbage collector may run code that logs while a line is taken.
        self._lock = threading.RLock()
        self._sinks: dict[Sink, None] = {}

    def begin(self) -> Callable[[], None]:
        """Keep lines from here on; returns a function, to be called once, that ends this.

        The last of several ends forgets the lines: a program may have more than one node.
        """
        with self._lock:
            self._users += 1
            if self._users == 1:
                self._run = object()
                self._make = logging.getLogRecordFactory()
                self._own = partial(self._make_record, self._run, self._make)
                logging.setLogRecordFactory(self._own)
        return self._leave

    def _leave(self) -> None:
        with self._lock:
            self._users -= 1
            if self._users == 0:
                # Other code may have wrapped it since; then it stays, and does nothing.
                self._run = None
                if logging.getLogRecordFactory() is self._own:
                    logging.setLogRecordFactory(self._make)
                self._kept.clear()

    def _make_record(self, run: object, make: RecordFactory, *args: Any, **kwargs: Any) -> logging.LogRecord:
        """Make a record, and take it while the `run` of the keeper lasts."""
        record = make(*args, **kwargs)
        if run is self._run:
            node = record.node = WORK[threading.get_ident()].node or self._others
            self._take(record)
            if self._prefix and node != self._others:
                record.msg = f"[{node}] {record.msg}"
        return record

    @contextmanager
    def naming_nodes(self, others: str, *, prefix: bool) -> Iterator[None]:
        """Keep lines within; those of threads that work for no node have the name `others`.

        With `prefix` the text of a node's record begins with the node's name: for programs with a log of their own.
        """
        end, before = self.begin(), (self._others, self._prefix)
        self._others, self._prefix = others, prefix
        try:
            yield
        finally:
            self._others, self._prefix = before
            end()

    def kept(self, process: str) -> list[LogLine]:
        """The newest lines of the process, or of the node of this name in it, the oldest first."""
        with self._lock:
            lines = list(self._kept)
        return [msgspec.structs.replace(line, process=process) for line in lines if line.process in ("", process)]

    def pass_to(self, sink: Sink) -> Callable[[], object]:
        """Call `sink(line)` for each new line, in the thread that logs; returns a function that ends this."""
        self._sinks[sink] = None
        return partial(self._sinks.pop, sink, None)

    def _take(self, record: logging.LogRecord) -> None:
        # None: `logging.makeLogRecord` makes an empty record first, to fill it with one of another process.
        if record.name is None:
            return
        try:
            # Without the lock: the arguments' own code makes the text.
            text, file, function = _text_of(record), _encodable(record.pathname), record.funcName or ""
            level = max(0, min(record.levelno, 255))
            with self._lock:
                now = wall_ns()
                # Equal lines differ in their time: readers take what they know for a repetition.
                self._last = self._last + 1 if now <= self._last < now + KEPT else now
                line = LogLine(self._last, node_of(record), level, text, file, function, record.lineno)
                self._kept.append(line)
            # A line that a sink logs itself would have no end.
            if self._sinks and not getattr(self._thread, "passing", False):
                self._thread.passing = True
                try:
                    for sink in [*self._sinks]:
                        sink(line)
                finally:
                    self._thread.passing = False
        except Exception:
            # Its handlers still get the record; a line about this one would fail as well.
            return


def _text_of(record: logging.LogRecord) -> str:
    """The message with the traceback of its exception, cut to MAX_TEXT."""
    try:
        text = record.getMessage()
    except Exception:
        # Arguments that do not fit: Python's handlers report that.
        text = str(record.msg)
    if record.exc_info and record.exc_info[0] is not None:
        text = f"{text}\n{logging.Formatter().formatException(record.exc_info)}"
    if len(text) > MAX_TEXT:
        text = f"{text[:MAX_TEXT]}… ({len(text)} characters)"
    return _encodable(text)


def _encodable(text: str) -> str:
    """The text with escapes for what neither JSON in UTF-8 nor CDR can carry."""
    if text.isascii() and "\0" not in text:
        return text
    return text.replace("\0", "\\x00").encode("utf-8", "backslashreplace").decode()


KEEPER = LogKeeper()
"""The one of this process, as the log is the process's."""
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=KEEPER.reset)


def node_of(record: logging.LogRecord) -> str:
    """The node whose line it is, where this process has several; else empty."""
    return getattr(record, "node", "")


class _Output(logging.Handler):
    """Writes lines of the process, as text or as JSON, to whatever is stderr at the time: the live table redirects it,
    so that lines scroll by above."""

    def __init__(self) -> None:
        super().__init__()
        self.process, self.as_json = "", False
        self.write: Callable[[str, str], None] | None = None
        """Takes the lines of the nodes in this process instead."""

    def format(self, record: logging.LogRecord) -> str:
        process, level, text = node_of(record) or self.process, record.levelname.lower(), record.getMessage()
        error = logging.Formatter().formatException(record.exc_info) if record.exc_info else ""
        if self.as_json:
            entry = {"time_ns": wall_ns(), "process": process, "level": level, "text": text}
            return printable_json(msgspec.json.encode({**entry, "exception": error} if error else entry).decode())
        told = "" if record.levelno == logging.INFO else f"{level}: "
        # Further lines of a text are indented: what a message holds must not look like a line of another process.
        shown = text.replace("\n", "\n    ")
        line = f"{local_time_text()} [{process}] {told}{shown}" + (f"\n{error}" if error else "")
        return printable(line, "\n\t")

    def emit(self, record: logging.LogRecord) -> None:
        try:
            node = node_of(record)
            if self.write is not None and node not in ("", self.process):
                self.write(node, self.format(record))
                return
            sys.stderr.write(self.format(record) + "\n")
            sys.stderr.flush()
        except Exception:
            self.handleError(record)


_OUTPUT = _Output()


def start_logging(name: str, level: str = "", form: str = "") -> None:
    """Send the log of zteam and of a user's modules to stderr under the process's name, and begin to keep its lines.

    Without a level or a form, the environment chooses.
    """
    level = level or os.environ.get("ZTEAM_LOG_LEVEL", "info")
    form = form or os.environ.get("ZTEAM_LOG_FORMAT", "text")
    _OUTPUT.process, _OUTPUT.as_json = name, form == "json"
    own, everything = logging.getLogger("zteam"), logging.getLogger()
    own.handlers[:] = [_OUTPUT]
    own.propagate = False
    everything.handlers[:] = [*(other for other in everything.handlers if other is not _OUTPUT), _OUTPUT]
    for logger in (own, everything):
        logger.setLevel(level.upper())
    # Its debug lines are thousands.
    logging.getLogger("PIL").setLevel(logging.WARNING)
    KEEPER.begin()


@contextmanager
def passing_lines(write: Callable[[str, str], None]) -> Iterator[None]:
    """Within, `write(node, text)` gets the lines of the nodes in this process."""
    _OUTPUT.write = write
    try:
        yield
    finally:
        _OUTPUT.write = None
