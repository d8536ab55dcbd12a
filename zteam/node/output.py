"""Standard output that cannot be written: a full disk, a closed descriptor, a closed pipe, an encoding of ASCII only.

A command that prints a result and cannot write it ends with one line on standard error and exit code 1. A command that
is useful without its output (`zteam up`, the monitor) says so once and goes on. Characters that the encoding lacks are
escaped.
"""

import contextlib
import os
import sys
from collections.abc import Callable
from typing import Any, TextIO, cast

from zteam.errors import ZteamError, printable, printable_json


class Clean(str):
    """Text that a terminal may get as it is: what does not come from zteam's own code has no control characters."""


def painted(text: str, color: int | str) -> Clean:
    """A line in a colour of ECMA-48, such as 31, or "1;31" for a bold one."""
    return Clean(f"\033[{color}m{printable(text)}\033[0m")


def print_line(*lines: str, file: TextIO | None = None) -> None:
    """Print each text as one line, at once; by default on standard output.

    Commands print in no other way: a name or a text of the bus neither commands the terminal nor begins a line.
    """
    stream = sys.stdout if file is None else file
    texts = [line if isinstance(line, Clean) else printable(line, "\t") for line in lines]
    stream.write("".join(f"{text}\n" for text in texts))
    stream.flush()


def print_block(text: str, file: TextIO | None = None) -> None:
    """Print lines as `print_line` does. What they were made of has no line breaks of its own."""
    print_line(*([text] if isinstance(text, Clean) else text.split("\n")), file=file)


def print_json(*values: object) -> None:
    """Print each value as one line of JSON, bytes as the JSON that they are; it commands no terminal."""
    texts = [each.decode() if isinstance(each, bytes) else _json(each) for each in values]
    print_line(*(Clean(printable_json(text)) for text in texts))


def _json(value: object) -> str:
    import msgspec

    try:
        return msgspec.json.encode(value).decode()
    except UnicodeEncodeError:
        import json

        # A file name that is no UTF-8 has a lone surrogate, which JSON carries as an escape alone.
        return json.dumps(msgspec.to_builtins(value, str_keys=True))


class OutputError(ZteamError):
    """Standard output cannot be written."""

    def __init__(self, reason: OSError) -> None:
        super().__init__(f"cannot write to standard output: {reason.strerror or reason}")
        self.reader_gone = isinstance(reason, BrokenPipeError)
        """Whether the reader of a pipe (head, less) closed it, which is no failure."""


class Output:
    """Wraps a text stream: the first failed write is passed to `on_failure`, and everything after it is dropped."""

    def __init__(self, stream: TextIO | None, on_failure: Callable[[OSError], None]) -> None:
        """A `stream` of None is one that was closed when the process started."""
        # What cannot be written to, as the descriptor that was closed.
        self._stream = os.fdopen(os.open(os.devnull, os.O_RDONLY), "w") if stream is None else stream
        self._drops = False
        self.on_failure = on_failure
        reconfigure = getattr(stream, "reconfigure", None)
        if reconfigure is not None:
            reconfigure(errors="backslashreplace")

    def __getattr__(self, name: str) -> Any:
        # Such as encoding, fileno and isatty.
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        """Write `text`; return its length even if it was dropped."""
        self._attempt(lambda: self._stream.write(text))
        return len(text)

    def flush(self) -> None:
        self._attempt(self._stream.flush)

    def _attempt(self, act: Callable[[], object]) -> None:
        if self._drops:
            return
        try:
            act()
        except OSError as error:
            self._drops = True
            # What the stream's buffer holds would fail to be written again when the interpreter ends.
            null = os.open(os.devnull, os.O_WRONLY)
            # It may have no descriptor.
            with contextlib.suppress(OSError, ValueError):
                os.dup2(null, self._stream.fileno())
            os.close(null)
            self.on_failure(error)


def guarded(name: str, body: Callable[[], int], *, needs_output: bool = True) -> int:
    """Run a command's `body`; return its exit code, or 1 if it `needs_output` and that cannot be written."""

    def failed(reason: OSError) -> None:
        error = OutputError(reason)
        if needs_output:
            raise error
        if not error.reader_gone:
            print_line(f"{name}: {error}; going on without it", file=sys.stderr)

    before = sys.stdout, sys.stderr
    if isinstance(sys.stdout, Output):
        # `zteam` runs a command, which decides from here on.
        sys.stdout.on_failure = failed
    else:
        _open_descriptors()
        sys.stdout = cast(TextIO, Output(sys.stdout, failed))
        # There is no stream left to report it on.
        sys.stderr = cast(TextIO, Output(sys.stderr, lambda error: None))
    try:
        try:
            return body()
        finally:
            sys.stdout.flush()
    except OutputError as error:
        if error.reader_gone:
            return 0
        print_line(f"{name}: {error}", file=sys.stderr)
        return error.exit_code
    finally:
        sys.stdout, sys.stderr = before


def _open_descriptors() -> None:
    """Open those of 0, 1 and 2 that are closed: otherwise the next pipe would become a child's standard output."""
    for descriptor in (0, 1, 2):
        try:
            os.fstat(descriptor)
        except OSError:
            os.set_inheritable(os.open(os.devnull, os.O_RDWR), True)
