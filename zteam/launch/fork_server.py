"""`python -P -m zteam.launch.fork_server N`: a warm parent. It imports once what children need, and forks them.

It has one thread and opens nothing, so a child begins like a new program: what `python -P -m module` would have
started, with an environment, a folder, arguments, signals and streams of its own. N is the descriptor of its orders.
"""

import gc
import importlib
import os
import socket
import sys
import warnings
from collections import deque

from zteam.launch.fork_protocol import PADDING, End, Load, Message, Reply, Start, has_message, receive, send
from zteam.launch.heap import fill_gaps
from zteam.launch.new_program import Program, prepare, write_command_line
from zteam.runtime.faults import shortage_text
from zteam.runtime.process_name import show_name

_DESCRIPTORS = 4
"""Of a child: standard input, output, error, lifeline."""


def serve(control: socket.socket) -> Program | None:
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
                program = _start(control, message, descriptors)
                if program is not None:
                    control.close()
                    return program
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


def _start(control: socket.socket, message: Start, descriptors: list[int]) -> Program | None:
    """Fork and reply; in the child, what it is to become."""
    try:
        program = prepare(message, descriptors)
        pid = _fork()
    except OSError as error:
        send(control, Reply(error=str(error)))
        return None
    if pid == 0:
        os.setpgid(0, 0)
        return program
    try:
        # Here too: the launcher may send a signal to the group at once.
        os.setpgid(pid, pid)
    except OSError:
        # It has ended already.
        pass
    send(control, Reply(pid))
    return None


def _fork() -> int:
    # The collector of a child leaves alone what all share: looking through it would copy it.
    gc.freeze()
    fill_gaps()
    with warnings.catch_warnings():
        # numpy's library for linear algebra has threads; it ends them before a fork. Later Pythons prefer another name
        # for the next function.
        warnings.simplefilter("ignore", DeprecationWarning)
        # Full of names of which imports have asked. As each gives way to one of the child's, its count of references
        # changes, on a page of its own.
        sys._clear_type_cache()
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


def main() -> None:
    """Serve, and in a child be what was asked for."""
    gc.disable()
    show_name("zteam-parent")
    write_command_line([os.fsencode(word) for word in sys.orig_argv if word != PADDING])
    try:
        program = serve(socket.socket(fileno=int(sys.argv[1])))
    except MemoryError as error:
        sys.exit(f"zteam-parent: {shortage_text(error)}")
    if program is not None:
        program.run()


if __name__ == "__main__":
    main()
