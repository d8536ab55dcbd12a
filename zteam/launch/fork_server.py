"""`python -P -m zteam.launch.fork_server N`: a warm parent. It imports once what children need, and forks them.

It has one thread and opens nothing, so a child begins like a new program: what `python -P -m module` would have
started, with an environment, a folder, arguments, signals and streams of its own. N is the descriptor of its orders.
"""

import ctypes
import gc
import importlib
import os
import runpy
import signal
import socket
import sys
import types
import warnings
from collections import deque
from collections.abc import Sequence
from importlib.machinery import FileFinder
from pathlib import Path

import msgspec

from zteam.launch.fork_protocol import PADDING, End, Load, Message, Reply, Start, has_message, receive, send
from zteam.runtime.process_name import show_name
from zteam.runtime.shutdown import PARENT_PIPE

_NOT_INHERITED = {signal.SIGPIPE, signal.SIGXFSZ, signal.SIGKILL, signal.SIGSTOP}
"""Python itself ignores the first two; the others cannot be set."""

_DESCRIPTORS = 4
"""Of a child: standard input, output, error, lifeline."""


class Task(msgspec.Struct, frozen=True):
    """What a forked process is to become, and its descriptors: standard input, output, error, lifeline."""

    start: Start
    descriptors: list[int]

    def run(self) -> None:
        """Become it. Its end is the end of the process."""
        _take_place(self.start, *self.descriptors)
        # What the interpreter itself calls for -m.
        runpy._run_module_as_main(os.fsdecode(self.start.command[3]))  # type: ignore[attr-defined]


def serve(control: socket.socket) -> Task | None:
    """Obey the messages of `control`. Returns in a child what it is to become; None when the other end is gone."""
    modules: deque[str] = deque()
    while True:
        if modules and not has_message(control):
            _load(modules.popleft())
            continue
        received = _receive(control)
        if received is None:
            return None
        message, descriptors = received
        match message:
            case Load():
                modules.extend(message.modules)
            case End():
                send(control, _exit_code(message))
            case Start() if len(descriptors) != _DESCRIPTORS:
                # Those for which this process has no room are lost.
                send(control, Reply(error="too many open files in the warm parent"))
            case Start():
                for module in message.needs:
                    _load(module)
                if _start(control) == 0:
                    control.close()
                    return Task(message, descriptors)
        for descriptor in descriptors:
            os.close(descriptor)


def _receive(control: socket.socket) -> tuple[Message, list[int]] | None:
    try:
        return receive(control)
    except ConnectionResetError:
        return None


def _load(module: str) -> None:
    try:
        importlib.import_module(module)
    except Exception:
        # The child that needs it imports it again, and says what is wrong.
        pass


def _start(control: socket.socket) -> int:
    """Fork and reply; 0 in the child."""
    try:
        pid = _fork()
    except OSError as error:
        send(control, Reply(error=str(error)))
        return -1
    if pid == 0:
        os.setpgid(0, 0)
        return 0
    try:
        # Here too: the launcher may send a signal to the group at once.
        os.setpgid(pid, pid)
    except OSError:
        # It has ended already.
        pass
    send(control, Reply(pid))
    return pid


def _fork() -> int:
    # The collector of a child leaves alone what all share: looking through it would copy it.
    gc.freeze()
    with warnings.catch_warnings():
        # numpy's library for linear algebra has threads; it ends them before a fork.
        warnings.simplefilter("ignore", DeprecationWarning)
        return os.fork()


def _exit_code(message: End) -> Reply:
    options = os.WEXITED | os.WNOHANG | (0 if message.release else os.WNOWAIT)
    try:
        result = os.waitid(os.P_PID, message.pid, options)
    except OSError as error:
        return Reply(error=str(error))
    if result is None:
        return Reply(error="it has not ended")
    return Reply(result.si_status if result.si_code == os.CLD_EXITED else -result.si_status)


def _take_place(start: Start, stdin: int, stdout: int, stderr: int, lifeline: int) -> None:
    """Change everything that a new program would find otherwise."""
    for place, descriptor in enumerate((stdin, stdout, stderr)):
        os.dup2(descriptor, place)
        os.close(descriptor)
    os.set_inheritable(lifeline, True)
    os.chdir(start.folder)
    os.umask(start.umask)
    os.environb.clear()
    os.environb.update({**start.environment, PARENT_PIPE.encode(): b"%d" % lifeline})
    for number in signal.valid_signals() - _NOT_INHERITED:
        usual = signal.default_int_handler if number == signal.SIGINT else signal.SIG_DFL
        wanted = signal.SIG_IGN if number in start.ignored else usual
        if signal.getsignal(number) not in (wanted, None):
            signal.signal(number, wanted)
    _start_afresh([os.fsdecode(word) for word in start.command])
    write_command_line(start.command)


def _start_afresh(command: Sequence[str]) -> None:
    """The state of the interpreter that the warm parent has changed."""
    sys.orig_argv[:] = command
    sys.argv[:] = ["-m", *command[4:]]
    sys.modules["__main__"] = types.ModuleType("__main__")
    _forget_folders()
    if "numpy.random" in sys.modules:
        # Python's own generator sees to it that children draw different numbers; numpy's does not.
        sys.modules["numpy.random"].seed()
    gc.enable()


def _forget_folders() -> None:
    """Let folders of the user be listed anew: modules may have come since.

    `importlib.invalidate_caches` would do so for all folders, also the interpreter's own with thousands of files, and
    import the finder of packages' metadata: a megabyte in each child.
    """
    for path, finder in sys.path_importer_cache.items():
        if isinstance(finder, FileFinder) and not path.startswith((sys.prefix, sys.base_prefix)):
            finder.invalidate_caches()


def write_command_line(words: Sequence[bytes]) -> None:
    """Show these words as the command line of this process, as far as there is room."""
    fields = Path("/proc/self/stat").read_bytes().rpartition(b")")[2].split()
    # Fields 48 and 49 of proc(5) stat; the list begins at field 3.
    begin, end = int(fields[45]), int(fields[46])
    size = end - begin
    if begin > 0 and size > 0:
        ctypes.memmove(begin, (b"\0".join(words)[: size - 1]).ljust(size, b"\0"), size)


def main() -> None:
    """Serve, and in a child be what was asked for."""
    gc.disable()
    show_name("zteam-parent")
    write_command_line([os.fsencode(word) for word in sys.orig_argv if word != PADDING])
    task = serve(socket.socket(fileno=int(sys.argv[1])))
    if task is not None:
        task.run()


if __name__ == "__main__":
    main()
