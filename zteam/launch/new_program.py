"""What makes a fork of the warm parent like a new program, such as `python -P -m module` would have started.

A child copies each page that it writes, be it for a count of references. So most is done in the warm parent before the
fork (`prepare`), which does not need its own folder, environment and arguments, and little in the child (`run`).
"""

import ctypes
import gc
import os
import runpy
import signal
import sys
import types
from collections.abc import Callable, Sequence
from contextlib import redirect_stderr, redirect_stdout
from functools import cache, partial
from importlib.machinery import FileFinder, ModuleSpec
from io import StringIO
from pathlib import Path
from types import CodeType

import msgspec

from zteam.launch.fork_protocol import Start
from zteam.runtime.shutdown import PARENT_PIPE

_NOT_INHERITED = {signal.SIGPIPE, signal.SIGXFSZ, signal.SIGKILL, signal.SIGSTOP}
"""Python itself ignores the first two; the others cannot be set."""


class Program(msgspec.Struct, frozen=True):
    """What a forked process is to become, and its descriptors: standard input, output, error, lifeline."""

    command: list[bytes]
    descriptors: list[int]
    body: Callable[[], object]

    def run(self) -> None:
        """Become it. Its end is the end of the process."""
        *streams, lifeline = self.descriptors
        for place, descriptor in enumerate(streams):
            os.dup2(descriptor, place)
            os.close(descriptor)
        os.set_inheritable(lifeline, True)
        write_command_line(self.command)
        sys.modules["__main__"] = types.ModuleType("__main__")
        gc.enable()
        self.body()


def prepare(start: Start, descriptors: list[int]) -> Program:
    """Change what a new program would find otherwise, in the process that is going to fork it. Raises OSError."""
    os.chdir(start.folder)
    os.umask(start.umask)
    os.environb.clear()
    os.environb.update({**start.environment, PARENT_PIPE.encode(): b"%d" % descriptors[-1]})
    for number in signal.valid_signals() - _NOT_INHERITED:
        usual = signal.default_int_handler if number == signal.SIGINT else signal.SIG_DFL
        wanted = signal.SIG_IGN if number in start.ignored else usual
        if signal.getsignal(number) not in (wanted, None):
            signal.signal(number, wanted)
    command = [os.fsdecode(word) for word in start.command]
    sys.orig_argv[:] = command
    sys.argv[:] = ["-m", *command[4:]]
    body = _find_body(command)
    _forget_folders()
    if "numpy.random" in sys.modules:
        # Python's own generator sees to it that children draw different numbers; numpy's does not.
        sys.modules["numpy.random"].seed()
    _place_of_command_line()
    return Program(start.command, descriptors, body)


def _find_body(command: Sequence[str]) -> Callable[[], object]:
    """What is to run. A module that was preloaded may have a function `prepared`, which reads the command line now."""
    module = sys.modules.get(command[3])
    prepared = getattr(module, "prepared", None)
    if module is None or prepared is None:
        spec, code = _find_code(command[3])
        sys.argv[0] = spec.origin or "-m"
        return partial(_run_module, spec, code)
    sys.argv[0] = module.__file__ or "-m"
    # What it says of a mistake is said again by the child.
    with redirect_stdout(StringIO()), redirect_stderr(StringIO()):
        body: Callable[[], object] = prepared(command[4:])
    return body


def _run_module(spec: ModuleSpec, code: CodeType) -> None:
    # What the interpreter itself calls for -m, once it has found the module.
    main = sys.modules["__main__"]
    runpy._run_code(code, main.__dict__, None, "__main__", spec)  # type: ignore[attr-defined]


@cache
def _find_code(module: str) -> tuple[ModuleSpec, CodeType]:
    """What the interpreter itself looks up for -m."""
    try:
        _, spec, code = runpy._get_module_details(module)  # type: ignore[attr-defined]
    except ImportError as error:
        raise OSError(str(error)) from None
    return spec, code


def _forget_folders() -> None:
    """Let folders of the user be listed anew: modules may have come since.

    `importlib.invalidate_caches` would do so for all folders, also the interpreter's own with thousands of files, and
    import the finder of packages' metadata: a megabyte in each child.
    """
    for path, finder in sys.path_importer_cache.items():
        if isinstance(finder, FileFinder) and not path.startswith((sys.prefix, sys.base_prefix)):
            finder.invalidate_caches()


@cache
def _place_of_command_line() -> tuple[int, int]:
    """Where the kernel looks for the words: address and size in bytes; a fork has the same."""
    fields = Path("/proc/self/stat").read_bytes().rpartition(b")")[2].split()
    # Fields 48 and 49 of proc(5) stat; the list begins at field 3.
    begin, end = int(fields[45]), int(fields[46])
    return begin, end - begin


def write_command_line(words: Sequence[bytes]) -> None:
    """Show these words as the command line of this process, as far as there is room."""
    begin, size = _place_of_command_line()
    if begin > 0 and size > 0:
        ctypes.memmove(begin, (b"\0".join(words)[: size - 1]).ljust(size, b"\0"), size)
