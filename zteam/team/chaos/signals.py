"""Processes that are killed or frozen on purpose: each by the launcher that started it, and by no other process.

A process id on the bus is what its sender says, so a tool that signalled it would end whatever a stranger names.
"""

import signal
import threading
from collections.abc import Callable, Mapping
from functools import partial
from typing import Annotated, Literal

import msgspec

from zteam import names
from zteam.bus import Bus, Change
from zteam.clock import HOST_FACTOR
from zteam.config.numbers import MAX_SECONDS
from zteam.errors import BusError
from zteam.node.kinds import ROUTER
from zteam.team.launch.process import Process

SignalKind = Literal["kill", "pause", "resume"]
_NUMBERS = {"kill": signal.SIGKILL, "pause": signal.SIGSTOP, "resume": signal.SIGCONT}
_REPLY = 0.2 * HOST_FACTOR
"""Host seconds for a reply to pass through the router, before that is killed or frozen itself."""


class SignalRequest(Change):
    """`up/signal`: kill a process that the launcher has started, freeze it, or let it go on."""

    name: str
    signal: SignalKind
    seconds: Annotated[float, msgspec.Meta(ge=0.0, le=MAX_SECONDS)] = 0.0
    """Host seconds after which a frozen process goes on by itself; 0 = never."""


class Signals:
    """Signals the processes of a launcher, by their names. A call raises BusError for a process that is not there."""

    def __init__(self, processes: Callable[[], Mapping[str, Process]]) -> None:
        """`processes()` are those that the launcher has started, by name."""
        self._processes = processes
        self._resumes: dict[Process, Callable[[], None]] = {}
        """By frozen process: what takes back that it goes on later."""

    def send(self, name: str, kind: SignalKind, seconds: float = 0.0) -> None:
        """Kill a process, freeze it for so many host seconds (0 = for good), or let it go on."""
        self._signal(self._find(name), kind, seconds)

    def _find(self, name: str) -> Process:
        process = self._processes().get(name)
        if process is None or not process.running:
            raise BusError(f"the launcher runs no process {name}{by_hand(name)}")
        return process

    def serve(self, bus: Bus) -> None:
        """Let `zteam chaos` signal the processes."""

        def answer(request: SignalRequest) -> str:
            process = self._find(request.name)
            act = partial(self._signal, process, request.signal, request.seconds)
            _later(_REPLY, act) if request.name == ROUTER else act()
            return request.name

        bus.serve(names.service_key(names.LAUNCHER, names.SIGNAL), SignalRequest, answer)

    def _signal(self, process: Process, kind: SignalKind, seconds: float) -> None:
        # That of an earlier pause would end this one.
        if (take_back := self._resumes.pop(process, None)) is not None:
            take_back()
        process.signal(_NUMBERS[kind])
        if kind == "pause" and seconds:
            # By its handle: the next process of this name may run by then.
            self._resumes[process] = _later(seconds, partial(process.signal, _NUMBERS["resume"]))


def _later(seconds: float, act: Callable[[], None]) -> Callable[[], None]:
    """Do it then; returns what takes it back."""
    # Host time: a frozen process has no other.
    timer = threading.Timer(seconds, act)  # noqa: TID251
    timer.daemon = True
    timer.start()
    return timer.cancel


def by_hand(name: str) -> str:
    """How a user kills or freezes a process that no launcher has started: the end of an error."""
    return (
        f": if {name} was started by hand, end it there with 'kill -9 PID', or freeze it with 'kill -STOP PID' and let "
        "it go on with 'kill -CONT PID' ('zteam node list' has host and PID)"
    )
