"""A command that runs to its end in a fork of a warm parent, as `subprocess.run` would run it."""

import contextlib
import os
import signal
import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryFile

from zteam.launch.warm_parent import WarmParent


def run_command(
    warm: WarmParent, command: Sequence[str], environment: Mapping[str, str], timeout: float
) -> "subprocess.CompletedProcess[str]":
    """Run a command without an input to its end; `environment` is added to this process's.

    Raises subprocess.TimeoutExpired after `timeout` host seconds.
    """
    with contextlib.ExitStack() as open_files:
        lifeline, writer = os.pipe()
        open_files.callback(os.close, lifeline)
        open_files.callback(os.close, writer)
        nothing = open_files.enter_context(Path(os.devnull).open())
        # Files, not pipes: two pipes would have to be read at the same time.
        outputs = [open_files.enter_context(TemporaryFile("w+", errors="replace")) for _ in range(2)]
        streams = [file.fileno() for file in (nothing, *outputs)]
        child = warm.start_with(command, [*streams, lifeline], environment)
        if child is None:
            return _spawn_to_end(command, environment, timeout)
        ended = child.has_ended(timeout)
        if not ended:
            child.send_signal(signal.SIGKILL)
        code = child.wait()
        if not ended:
            raise subprocess.TimeoutExpired(list(command), timeout)
        for file in outputs:
            file.seek(0)
        return subprocess.CompletedProcess(list(command), code, *(file.read() for file in outputs))


def _spawn_to_end(
    command: Sequence[str], environment: Mapping[str, str], timeout: float
) -> "subprocess.CompletedProcess[str]":
    return subprocess.run(
        command,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        timeout=timeout,
        check=False,
        stdin=subprocess.DEVNULL,
    )
