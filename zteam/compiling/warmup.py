"""A child process that compiles a set of kernels into the cache. The set's own module gives a sample of each call.

One kernel is compiled after the other and kept at once: what a process that ends early had finished is not lost.
"""

import argparse
import os
import sys
import threading
from collections.abc import Callable, Sequence

from zteam.compiling import kernel_cache
from zteam.compiling.kernels import Kernel
from zteam.compiling.takeover import FAILED

_NICE = 10
"""A process beside a running simulator gets about a tenth of the time that the others do."""


def _end_with_parent() -> None:
    # The parent holds the other end: this reads nothing until that process is gone, however it went.
    os.read(sys.stdin.fileno(), 1)
    os._exit(1)


def _compile(kernels: Sequence[Kernel], *, backwards: bool) -> None:
    for kernel in reversed(kernels) if backwards else kernels:
        kernel.compile()
        kernel.keep()
        _tell(f"{len(kernels)} {kernel.name} {kernel.dispatcher.stats.cache_path}")


def _tell(line: str) -> None:
    sys.stdout.write(line + "\n")
    sys.stdout.flush()


def warm_up(find_kernels: Callable[[], Sequence[Kernel]]) -> int:
    """Compile and keep all that `find_kernels` gives, as the command line says; return the exit code.

    Writes a line for every kernel that is ready: how many there are, its name, and its folder.
    """
    parser = argparse.ArgumentParser(description="compiles a set of kernels into the cache; a child of a process")
    parser.add_argument("--nice", action="store_true", help="give way to other processes")
    parser.add_argument("--backwards", action="store_true", help="begin at the end, where another begins at the start")
    args = parser.parse_args()
    if args.nice:
        os.nice(_NICE)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    try:
        _compile(find_kernels(), backwards=args.backwards)
    except OSError as error:
        _tell(f"{FAILED}{kernel_cache.FOLDER}: {error.strerror}")
        return 1
    except Exception as error:
        # The parent says so and goes on without.
        _tell(f"{FAILED}{type(error).__name__}: {str(error).partition(chr(10))[0]}")
        return 1
    return 0
