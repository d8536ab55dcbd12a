"""What the checks judge, everything that was learned of one team within a moment, as plain data; and what they find."""

from collections.abc import Mapping, Sequence
from typing import Literal

import msgspec

from zteam import names
from zteam.bus.presence import ProcessInfo
from zteam.bus.receiving import KeyCount
from zteam.messages import OccupancyGrid, RobotStatus, TeamStatus
from zteam.simulator.client import SimStatus
from zteam.transforms.lasers import LaserProblem


class Finding(msgspec.Struct, frozen=True):
    what: str
    good: bool
    """False for a problem that exists now."""
    text: str
    next_step: str = ""
    """What to do about it; empty where there is nothing to do."""
    level: Literal["ok", "note", "problem"] = "ok"
    """A note is good: history, or a state that may be intended."""


def ok(what: str, text: str) -> Finding:
    """A check without a problem."""
    return Finding(what, True, text)


def note(what: str, text: str, next_step: str = "") -> Finding:
    """A state that may be intended, or a problem of the past."""
    return Finding(what, True, text, next_step, "note")


def problem(what: str, text: str, next_step: str = "") -> Finding:
    """A problem that exists now."""
    return Finding(what, False, text, next_step, "problem")


class UnusableMessages(msgspec.Struct, frozen=True):
    """Messages that no process of zteam can use."""

    key: str
    writer: str
    """The name of the process that sends them, or its session."""
    reason: str
    """What is wrong with them: `sends <reason>`."""


class Load(msgspec.Struct, frozen=True):
    """What one session publishes."""

    writer: str
    """The name of the process, or its session."""
    known: bool
    """Whether it is a process of the team."""
    rates: Mapping[str, float]
    """Messages a host second, by key; at least one."""
    size: float
    """Bytes a host second on all keys."""


class HostClock(msgspec.Struct, frozen=True):
    """The clock of a host, compared with this host's."""

    ahead: float
    """Seconds; negative if it is behind."""
    error: float
    """The most that `ahead` may be wrong: half the time that question and answer took."""


class Facts(msgspec.Struct, frozen=True, kw_only=True):
    """One team. An empty field says that nothing of the kind was heard."""

    nodes: Sequence[ProcessInfo] = ()
    """Every process with a presence token; one that does not answer has pid 0."""
    writers: Mapping[str, Sequence[str]] = {}
    """The processes that published on each key, by name."""
    publishers: Mapping[str, Sequence[str]] = {}
    """The processes that have a publisher of each key, by name; those of other programs than zteam's are not known."""
    unpublished: Mapping[str, str] = {}
    """Keys to which nodes of users subscribe, and which nothing publishes, with the words on the key that is meant."""
    faults: Sequence[UnusableMessages] = ()
    dropped: Mapping[str, Sequence[str]] = {}
    """The processes, by name, that publish on a key on which the router drops what they send, by key."""
    counts: Mapping[str, Mapping[str, KeyCount]] = {}
    """What each process received and refused, by process and key."""
    statuses: Mapping[int, RobotStatus] = {}
    """What each robot's process says of itself."""
    team: TeamStatus | None = None
    """What the monitor says of the team."""
    sim: SimStatus | None = None
    holds: bool = False
    """Whether the simulator's tick was the same at the begin and at the end of the look."""
    frames: Mapping[str, str] | None = None
    """The parent of each frame of the aggregator's tree; None without an aggregator."""
    leads: Mapping[str, float] = {}
    """Seconds by which the stamps of what bases measure are ahead of this host's clock, by key, without a simulator."""
    lasers: Mapping[str, LaserProblem] = {}
    """Why no robot can use the scans of a key, by the transforms of the aggregator's tree."""
    map: OccupancyGrid | None = None
    """The map that a late subscriber gets; its cells are left out."""
    map_writer: str = ""
    """The process that published it, by name."""
    loads: Sequence[Load] = ()
    tick_rate: float = 0.0
    """Ticks of the simulator in a host second."""
    strangers: Sequence[str] = ()
    """Sessions at the router that are none of zteam's, as text, with their addresses."""
    clocks: Mapping[str, HostClock] = {}
    """The clocks of other hosts, by host."""
    namespace: str = ""
    """Where the look was made; empty for no namespace."""
    elsewhere: Mapping[str, Sequence[str]] = {}
    """Names of the processes in other namespaces of the same router; "" is no namespace."""
    routers: Mapping[str, Sequence[str]] = {}
    """Names of the processes at other routers of this machine, by endpoint; `namespace/name` in a namespace."""

    @property
    def alive(self) -> frozenset[str]:
        return frozenset(node.name for node in self.nodes)

    @property
    def robots(self) -> list[int]:
        return sorted({i for i in map(names.robot_id_of, self.alive) if i is not None})

    def lacks(self, robot_id: int) -> bool:
        return self.sim is not None and robot_id not in self.sim.robots

    @property
    def is_held(self) -> bool:
        """Whether participants of lock-step hold the world."""
        return self.sim is not None and self.sim.lockstep and self.holds and bool(self.sim.waiting_for)

    @property
    def stands_still(self) -> bool:
        """Whether the simulator sends no data: the world stands, or the simulator does not answer."""
        if self.sim is None:
            return names.SIMULATOR in self.alive
        return self.sim.paused or self.sim.finished or self.is_held
