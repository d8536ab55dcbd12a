"""How a fault reaches a process: by a signal, over its link, or in the simulator's world."""

import os
import signal
import socket
from collections.abc import Callable
from typing import NamedTuple

from zteam import names
from zteam.bus import Bus, BusOptions
from zteam.bus.presence import ProcessInfo
from zteam.config.fault import Fault
from zteam.errors import BusError
from zteam.node.kinds import ROUTER
from zteam.simulator.client import SimulatorClient
from zteam.simulator.faults import is_simulated
from zteam.team.chaos.forwarder import Wire
from zteam.team.chaos.links import LinkReply, LinkRequest, no_link

_MARGIN = 5.0
"""Host seconds after the end of a fault until a link heals by itself, if the process that cut it is gone."""


class Means(NamedTuple):
    """What reaches the processes of a team. Each raises ZteamError where it cannot."""

    pid_of: Callable[[str], int]
    """The process id of a process by its name."""
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
        self._pid = 0
        if means.simulate is not None and self.in_world:
            means.simulate(fault)
        elif fault.fault in ("kill", "pause"):
            self._pid = means.pid_of(fault.name)
            self._send(signal.SIGKILL if fault.fault == "kill" else signal.SIGSTOP)
        else:
            wire = Wire(stalled=True) if fault.fault == "cut" else Wire(fault.delay, fault.rate)
            means.change_link(fault.name, wire, fault.seconds + _MARGIN)

    def end(self) -> None:
        """End it."""
        if self.in_world or self.fault.fault == "kill":
            return
        if self.fault.fault == "pause":
            self._send(signal.SIGCONT)
        else:
            self._means.change_link(self.fault.name, Wire(), 0.0)

    def _send(self, number: int) -> None:
        try:
            os.kill(self._pid, number)
        except OSError as error:
            raise BusError(f"{self.fault.name} (process {self._pid}): {error.strerror}") from None


def means_on_bus(bus: Bus, options: BusOptions, *, lockstep: bool) -> Means:
    """Those for a team that others have started: processes of this host, and what its launcher and simulator do."""

    def pid_of(name: str) -> int:
        if name == ROUTER:
            from zteam.bus.router import read_admin

            record = read_admin(options)
            if record is None or record.metadata is None or record.metadata.pid is None:
                raise BusError("the process of the router is not known: it is none of zteam's")
            return record.metadata.pid
        infos = [info for _, info in bus.query(names.info_key(name), ProcessInfo)]
        if not infos:
            raise BusError(f"{name} does not answer: 'zteam node list' shows what runs")
        if infos[0].host != socket.gethostname():
            raise BusError(f"{name} runs on {infos[0].host}: it can be killed or paused there alone")
        return infos[0].pid

    def change_link(name: str, wire: Wire, seconds: float) -> None:
        key = names.service_key(names.LAUNCHER, names.LINKS)
        if not bus.query(key, LinkReply, LinkRequest(name=name, wire=wire, seconds=seconds)):
            no_link(name, wire, seconds)

    return Means(pid_of, change_link, SimulatorClient(bus).fault if lockstep else None)
