"""Faults on purpose: how each reaches a process, by a signal of its launcher, over its link, or in the world of the
simulator; and plans of them, which are TOML files or drawn by a seed.

A process is signalled by the launcher that started it alone: a process id on the bus is what its sender says, so a tool
that signalled it would end whatever a stranger names.
"""

import signal
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Literal, NamedTuple

import msgspec

from zteam import names
from zteam.bus import Bus, Change
from zteam.clock import HOST_FACTOR, later
from zteam.config.fault import KINDS, Fault, FaultKind
from zteam.config.numbers import Seconds, counted, parse_number
from zteam.config.problems import Problem, problems_of
from zteam.config.toml_values import toml_text
from zteam.counter_random import stream, uniform
from zteam.errors import BusError, ConfigError, UsageError, did_you_mean
from zteam.node.kinds import ROUTER, kind_of
from zteam.simulator.client import SimulatorClient
from zteam.simulator.faults import is_simulated
from zteam.team.file.sources import KeyPlace, Mistake, Source, error_of, read_toml
from zteam.team.launch.process import Process

SignalKind = Literal["kill", "pause", "resume"]
_NUMBERS = {"kill": signal.SIGKILL, "pause": signal.SIGSTOP, "resume": signal.SIGCONT}
_REPLY = 0.2 * HOST_FACTOR
"""Host seconds for a reply to pass through the router, before that is killed or frozen itself."""
_MARGIN = 5.0
"""Host seconds after the end of a fault until a link heals by itself, if the process that cut it is gone."""
FIRST = 3.0
"""Simulated seconds after GO before the first fault of a random plan."""
SHORTEST, LONGEST = 0.5, 4.0
"""Simulated seconds of a random fault."""
_PAUSE = 4.0, 10.0
"""Simulated seconds from the end of a random fault to the beginning of the next one: a team recovers meanwhile."""
_DELAYS = 0.05, 1.6
"""Seconds of a random slow link."""


class SignalRequest(Change):
    """`up/signal`: kill a process that the launcher has started, freeze it, or let it go on."""

    name: str
    signal: SignalKind
    seconds: Seconds = 0.0
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
    seconds: Seconds = 0.0
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
            later(_REPLY, act, "signal") if request.name == ROUTER else act()
            return request.name

        bus.serve(names.service_key(names.LAUNCHER, names.SIGNAL), SignalRequest, answer)

    def _signal(self, process: Process, kind: SignalKind, seconds: float) -> None:
        # That of an earlier pause would end this one.
        if (take_back := self._resumes.pop(process, None)) is not None:
            take_back()
        process.signal(_NUMBERS[kind])
        if kind == "pause" and seconds:
            # By its handle: the next process of this name may run by then. Host time: a frozen process has no other.
            self._resumes[process] = later(seconds, partial(process.signal, _NUMBERS["resume"]), "resume")


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
    """Begin a fault; returns what ends it, which is nothing where it ends by itself. Both raise ZteamError."""
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


def read_plan(path: Path) -> tuple[Fault, ...]:
    """The faults of a plan file, in the order of time. Raises ConfigError with a line for each mistake."""
    lines, tables = read_toml(path, "plan of faults")
    source, entries = Source(path, lines), tables.get("faults")
    if isinstance(entries, list):
        problems = [Problem((key,), "unknown key; a plan has only faults") for key in tables if key != "faults"]
        for i, entry in enumerate(entries):
            problems += problems_of(entry, Fault, ("faults", i))
    else:
        problems = [Problem(("faults",), "write a table [[faults]] with at, fault and name for each fault")]
    if problems:
        raise error_of(Mistake(KeyPlace(source, problem.path), problem.text) for problem in problems)
    return tuple(sorted(msgspec.convert(entries, list[Fault]), key=lambda fault: fault.at))


def random_plan(
    seed: int, seconds: float, processes: Sequence[str], kinds: Sequence[FaultKind] = KINDS
) -> tuple[Fault, ...]:
    """Faults of these processes, one after the other, in so many simulated seconds after GO; equal seeds, equal plans.
    The router has no link of its own, because those of the others end there, and with a simulator that is killed the
    time of the run begins anew: these are paused instead."""
    chosen, plan, at = sorted(processes), list[Fault](), FIRST
    while chosen and at < seconds:
        draws = [uniform(seed, len(plan), i) for i in range(3)]
        name = chosen[stream(seed, len(plan), 5) % len(chosen)]
        fault = kinds[stream(seed, len(plan), 6) % len(kinds)]
        lasts = _between((SHORTEST, LONGEST), draws[0])
        kind = kind_of(name)
        has_link = kind is None or kind.on_bus
        if (fault in ("cut", "slow") and not has_link) or (fault == "kill" and name == names.SIMULATOR):
            fault = "pause"
        # A millisecond is finer than a tick, and short to read.
        delay = round(_between(_DELAYS, draws[1]), 3)
        plan.append(Fault(at=round(at, 3), fault=fault, name=name, seconds=lasts, delay=delay))
        at += plan[-1].lasts + _between(_PAUSE, draws[2])
    return tuple(plan)


def _between(bounds: tuple[float, float], share: float) -> float:
    return round(bounds[0] + share * (bounds[1] - bounds[0]), 3)


def plan_text(faults: Sequence[Fault], comment: str = "") -> str:
    tables = []
    for fault in faults:
        unused = {"kill": ("for", "delay", "rate"), "slow": ()}.get(fault.fault, ("delay", "rate"))
        told = [(key, value) for key, value in msgspec.to_builtins(fault).items() if key not in unused]
        lines = [f"{key} = {toml_text(value)}\n" for key, value in told if value is not None]
        tables.append("[[faults]]\n" + "".join(lines))
    return "\n".join([f"# {comment}\n" if comment else "", *tables]).lstrip("\n")


def choose_plan(text: str, seconds: float | None, processes: Sequence[str], *, lockstep: bool) -> tuple[Fault, ...]:
    """The plan that a user names: a file, or the seed of a random one of so many simulated seconds. Raises UsageError,
    and ConfigError for a fault of a process that is not there. In lock-step a random plan has faults that repeat."""
    if not text.isdigit():
        plan = read_plan(Path(text))
        for fault in plan:
            if fault.name not in processes:
                hint = did_you_mean(fault.name, processes) or f"; it has {', '.join(processes)}"
                raise ConfigError(f"{text}: the team has no process {fault.name!r}{hint}")
        return plan
    if seconds is None:
        raise UsageError(f"a plan of seed {text} needs an end: say --for SECONDS")
    seed = parse_number(text, 0, 2**63 - 1, "the seed of a plan")
    if lockstep:
        robots = [name for name in processes if names.robot_id_of(name) is not None]
        return random_plan(seed, seconds, robots, KINDS[1:])
    return random_plan(seed, seconds, [name for name in processes if not names.is_view(name)])


def describe(plan: Sequence[Fault]) -> str:
    """How many faults of which kinds."""
    counts = {kind: sum(fault.fault == kind for fault in plan) for kind in KINDS}
    listed = ", ".join(f"{count} {kind}" for kind, count in counts.items() if count)
    return f"{counted(len(plan), 'fault')} ({listed})" if plan else "no faults"
