"""How a fault reaches a process: by a signal of its launcher, over its link, or in the simulator's world."""

from collections.abc import Callable
from typing import NamedTuple

from zteam import names
from zteam.bus import Bus
from zteam.config.fault import Fault
from zteam.errors import BusError
from zteam.simulator.client import SimulatorClient
from zteam.simulator.faults import is_simulated
from zteam.team.chaos.links import LinkReply, LinkRequest, Wire, no_link
from zteam.team.chaos.signals import SignalKind, SignalRequest, by_hand

_MARGIN = 5.0
"""Host seconds after the end of a fault until a link heals by itself, if the process that cut it is gone."""


class Means(NamedTuple):
    """What reaches the processes of a team. Each raises ZteamError where it cannot."""

    signal: Callable[[str, SignalKind, float], object]
    """`signal(name, kind, seconds)`: kills a process, freezes it for so many host seconds, or lets it go on."""
    change_link: Callable[[str, Wire, float], object]
    """`change_link(name, wire, seconds)`: both directions of a link, for so many host seconds; 0 = for good."""
    simulate: Callable[[Fault], object] | None = None
    """In lock-step: carries out a fault in the world; None in real time."""


class Stroke:
    """One fault on its way. Raises ZteamError if it cannot begin or end."""

    def __init__(self, fault: Fault, means: Means) -> None:
        """Begin it."""
        self.fault, self._means = fault, means
        self.in_world = means.simulate is not None and is_simulated(fault)
        """Whether the simulator carries it out, and ends it too."""
        if means.simulate is not None and self.in_world:
            means.simulate(fault)
        elif fault.fault in ("kill", "pause"):
            means.signal(fault.name, fault.fault, fault.lasts)
        else:
            wire = Wire(stalled=True) if fault.fault == "cut" else Wire(fault.delay, fault.rate)
            means.change_link(fault.name, wire, fault.seconds + _MARGIN)

    def end(self) -> None:
        """End it."""
        if self.in_world or self.fault.fault == "kill":
            return
        if self.fault.fault == "pause":
            self._means.signal(self.fault.name, "resume", 0.0)
        else:
            self._means.change_link(self.fault.name, Wire(), 0.0)


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
