"""Commands of zteam in forks of one process that has imported them: a start without the interpreter's and the imports'.

The process has one thread and no session when it forks. Run as a program, this file is that process.
"""

import importlib
import json
import os
import pkgutil
import runpy
import signal
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import IO, Any, NamedTuple, Self

from zteam.clock import HOST_FACTOR

_LONGEST = 60.0 * HOST_FACTOR
"""Host seconds of one command: support.limits.LIMIT, which the program that this file is cannot import."""
_PRELOADED = (
    "zteam.cli",
    "zteam.team.launch",
    "zteam.team.file",
    "zteam.simulator",
    "zteam.simulator.world",
    "zteam.robot.behaviors",
)


class Ended(NamedTuple):
    """How a command ended."""

    exit_code: int
    """Negative for a signal."""
    output: str
    """Standard output and standard error."""


class Forks:
    """The process that forks. Use it in `with`."""

    def __enter__(self) -> Self:
        self._process = subprocess.Popen(
            [sys.executable, "-P", __file__], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._process.communicate()

    def run(self, words: Sequence[str], environment: Mapping[str, str], folder: Path) -> Ended:
        """Run a command such as `zteam topic list` in a folder, with further environment, and without an input."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        print(json.dumps([list(words), dict(environment), str(folder)]), file=self._process.stdin, flush=True)
        return Ended(*json.loads(self._process.stdout.readline()))


def _become(words: list[str], environment: dict[str, str], folder: str, output: IO[Any]) -> None:
    """Be a command in this process, which has been forked for it."""
    signal.alarm(round(_LONGEST))  # noqa: TID251
    os.chdir(folder)
    os.environ.update(environment)
    for number, source in enumerate((os.open(os.devnull, os.O_RDONLY), output.fileno(), output.fileno())):
        os.dup2(source, number)
    sys.stdout, sys.stderr = (os.fdopen(number, "w", buffering=1) for number in (1, 2))
    sys.argv = words if words[0] == "zteam" else ["zteam", *words]
    runpy.run_module("zteam", run_name="__main__", alter_sys=True)


def _fork(request: list[Any]) -> Ended:
    with tempfile.TemporaryFile("w+", errors="replace") as output:
        pid = os.fork()
        if pid == 0:
            code: Any = 1
            try:
                _become(*request, output)
            except SystemExit as end:
                code = end.code if isinstance(end.code, int) else int(end.code is not None)
            except BaseException:
                sys.excepthook(*sys.exc_info())
            finally:
                sys.stdout.flush()
                os._exit(code)
        _, status = os.waitpid(pid, 0)
        output.seek(0)
        return Ended(os.waitstatus_to_exitcode(status), output.read())


def main() -> None:
    """Fork for each line of standard input: words, environment, folder."""
    for package in map(importlib.import_module, _PRELOADED):
        for found in pkgutil.iter_modules(package.__path__, f"{package.__name__}."):
            importlib.import_module(found.name)
    for line in sys.stdin:
        sys.stdout.write(json.dumps(_fork(json.loads(line))) + "\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
