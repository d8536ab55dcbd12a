"""Standard output that may not be writable: a full disk, a closed descriptor, a reader that has gone, ASCII only.

A command that prints a result ends with one line on standard error and 1 where its output cannot be written. A command
that works on without (`zteam up`, the monitor) says so once and goes on. What the encoding cannot show is escaped.
"""

import errno
import io
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, TextIO, cast

from zteam.errors import ZteamError


class OutputError(ZteamError):
    """Standard output cannot be written."""

    def __init__(self, reason: OSError) -> None:
        super().__init__(f"cannot write to standard output: {reason.strerror or reason}")
        self.reader_gone = isinstance(reason, BrokenPipeError)
        """Whether it was a pipe whose reader has read enough (head, less), which is no failure."""


class Output:
    """A text stream in front of another one, whose first failure to write goes to `on_failure`; then it drops all."""

    def __init__(self, stream: TextIO | None, on_failure: Callable[[OSError], None]) -> None:
        """`stream` None is one that was closed from the start."""
        self._stream = io.StringIO() if stream is None else stream
        self._is_open = stream is not None
        self._drops = False
        self.on_failure = on_failure
        reconfigure = getattr(stream, "reconfigure", None)
        if reconfigure is not None:
            reconfigure(errors="backslashreplace")

    def __getattr__(self, name: str) -> Any:
        # Its encoding, its descriptor, whether it is a terminal.
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        """Write all of it, or none."""
        self._attempt(lambda: self._stream.write(text))
        return len(text)

    def flush(self) -> None:
        """Write what is buffered."""
        if self._is_open:
            self._attempt(self._stream.flush)

    def _attempt(self, act: Callable[[], object]) -> None:
        if self._drops:
            return
        try:
            if not self._is_open:
                raise OSError(errno.EBADF, os.strerror(errno.EBADF))
            act()
        except OSError as error:
            self._drops = True
            _discard(self._stream)
            self.on_failure(error)


def _discard(stream: TextIO) -> None:
    """Let what a stream has buffered go nowhere: it would fail once more at the interpreter's end."""
    null = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(null, stream.fileno())
    except (OSError, ValueError):
        # No stream with a descriptor.
        pass
    finally:
        os.close(null)


def guarded(name: str, body: Callable[[], int], *, needs_output: bool = True) -> int:
    """Run a command's `body`; its exit code, or 1 if its output cannot be written and it `needs_output`."""
    with _guarded_streams(_raise if needs_output else lambda error: _tell(name, error)):
        try:
            try:
                return body()
            finally:
                sys.stdout.flush()
        except OutputError as error:
            if error.reader_gone:
                return 0
            print(f"{name}: {error}", file=sys.stderr)
            return error.exit_code


@contextmanager
def _guarded_streams(on_failure: Callable[[OSError], None]) -> Iterator[None]:
    if isinstance(sys.stdout, Output):
        # A command within another one, which is the `zteam` that calls it.
        sys.stdout.on_failure = on_failure
        yield
        return
    _open_descriptors()
    before = sys.stdout, sys.stderr
    sys.stdout = cast(TextIO, Output(sys.stdout, on_failure))
    # Nothing is left to say it on.
    sys.stderr = cast(TextIO, Output(sys.stderr, lambda error: None))
    try:
        yield
    finally:
        sys.stdout, sys.stderr = before


def _raise(error: OSError) -> None:
    raise OutputError(error)


def _tell(name: str, error: OSError) -> None:
    failure = OutputError(error)
    if not failure.reader_gone:
        print(f"{name}: {failure}; going on without it", file=sys.stderr)


def _open_descriptors() -> None:
    """Open what the caller has closed of 0, 1 and 2: the next pipe would become a child's standard output."""
    for descriptor in (0, 1, 2):
        try:
            os.fstat(descriptor)
        except OSError:
            os.set_inheritable(os.open(os.devnull, os.O_RDWR), True)
