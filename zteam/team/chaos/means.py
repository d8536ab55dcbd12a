"""How a fault reaches a process: by a signal of its launcher, over its link, or in the world of the simulator.

A process is signalled by the launcher that started it alone: a process id on the bus is what its sender says, so a tool
that signalled it would end whatever a stranger names.
"""

import signal
import threading
from collections.abc import Callable, Mapping
from functools import partial
from typing import Annotated, Literal, NamedTuple

import msgspec

from zteam import names
from zteam.bus import Bus, Change
from zteam.clock import HOST_FACTOR
from zteam.config.fault import Fault
from zteam.config.numbers import MAX_SECONDS
from zteam.errors import BusError
from zteam.node.kinds import ROUTER
from zteam.simulator.client import SimulatorClient
from zteam.simulator.faults import is_simulated
from zteam.team.launch.process import Process

SignalKind = Literal["kill", "pause", "resume"]
_NUMBERS = {"kill": signal.SIGKILL, "pause": signal.SIGSTOP, "resume": signal.SIGCONT}
_REPLY = 0.2 * HOST_FACTOR
"""Host seconds for a reply to pass through the router, before that is killed or frozen itself."""
_MARGIN = 5.0
"""Host seconds after the end of a fault until a link heals by itself, if the process that cut it is gone."""
_Seconds = Annotated[float, msgspec.Meta(ge=0.0, le=MAX_SECONDS)]


class SignalRequest(Change):
    """`up/signal`: kill a process that the launcher has started, freeze it, or let it go on."""

    name: str
    signal: SignalKind
    seconds: _Seconds = 0.0
    """Host seconds after which a frozen process goes on by itself; 0 = never."""


class Wire(msgspec.Struct, frozen=True):
    """One direction of a link. The default is a good one."""

    delay: float = 0.0
    """Host seconds that each byte takes."""
    rate: float | None = None
    """Bytes a host second; None = as fast as they come. With a `delay` a direction holds 4 MiB at most, and without a
    rate as much as 1 MiB a second: then its sender waits."""
    stalled: bool = False
    """Whether no byte passes. What waits passes when this ends."""


GOOD = Wire()


class LinkRequest(Change):
    """`up/links`: how the link of a process is from now on, in both directions; a good one by default."""

    name: str
    wire: Wire = GOOD
    seconds: _Seconds = 0.0
    """Host seconds after which it is a good one again by itself; 0 = never."""


class LinkReply(msgspec.Struct):
    """The processes whose links can be changed."""

    names: list[str]


def no_link(name: str, _wire: Wire, _seconds: float) -> None:
    """In the place of `Links.change`, for a team without links of its own."""
    raise BusError(f"the link of {name} cannot be changed: start the team with 'zteam up --chaos'")


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


class Means(NamedTuple):
    """What reaches the processes of a team. Each raises ZteamError where it cannot."""

    signal: Callable[[str, SignalKind, float], object]
    """`signal(name, kind, seconds)`: kills a process, freezes it for so many host seconds, or lets it go on."""
    change_link: Callable[[str, Wire, float], object]
    """`change_link(name, wire, seconds)`: both directions of a link, for so many host seconds; 0 = for good."""
    simulate: Callable[[Fault], object] | None = None
    """In lock-step: carries out a fault in the world; None in real time."""


def strike(fault: Fault, means: Means) -> Callable[[], object]:
    """Begin a fault; returns what ends it, which is nothing for a kill, and where the simulator does so. Both raise
    ZteamError."""
    name = fault.name
    if means.simulate is not None and is_simulated(fault):
        means.simulate(fault)
    elif fault.fault in ("kill", "pause"):
        means.signal(name, fault.fault, fault.lasts)
        if fault.fault == "pause":
            return partial(means.signal, name, "resume", 0.0)
    else:
        wire = Wire(stalled=True) if fault.fault == "cut" else Wire(fault.delay, fault.rate)
        means.change_link(name, wire, fault.seconds + _MARGIN)
        return partial(means.change_link, name, GOOD, 0.0)
    return lambda: None


def means_on_bus(bus: Bus, *, lockstep: bool) -> Means:
    """Those for a team that another process has started: its launcher and its simulator carry them out."""

    def signal(name: str, kind: SignalKind, seconds: float) -> None:
        request = SignalRequest(name=name, signal=kind, seconds=seconds)
        answers = bus.query(names.service_key(names.LAUNCHER, names.SIGNAL), str, request)
        # The launcher ends a pause by itself: it may not be reached while the router is frozen.
        if not answers and kind != "resume":
            raise BusError(f"no 'zteam up' answers, and a process is signalled by its launcher alone{by_hand(name)}")

    def change_link(name: str, wire: Wire, seconds: float) -> None:
        key = names.service_key(names.LAUNCHER, names.LINKS)
        if not bus.query(key, LinkReply, LinkRequest(name=name, wire=wire, seconds=seconds)):
            no_link(name, wire, seconds)

    return Means(signal, change_link, SimulatorClient(bus).fault if lockstep else None)
