"""How long a team needs to recover from the death of each of its processes, and from a simulator that stands still."""

import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager
from itertools import pairwise

import msgspec

from studies.launching import LIMIT, Launch, launch
from zteam import names
from zteam.bus import Bus, BusOptions, connect
from zteam.bus.presence import ProcessInfo
from zteam.bus.router import read_admin
from zteam.cli.tables import format_table
from zteam.clock import monotonic, pause, wait_until
from zteam.errors import ZteamError
from zteam.messages import Odometry, Twist
from zteam.node.kinds import ROUTER

FROZEN = "sim frozen 5 s"
PROCESSES = ("robot_0", "robot_2", names.AGGREGATOR, names.MONITOR, names.VIEW, ROUTER, names.SIMULATOR)
ROWS = (*PROCESSES, FROZEN)
_FREEZE = 5.0
_SILENT = 0.25
"""Host seconds without a command from which on a robot stands: the simulator obeys the last one for 0.2."""
_LATEST = 1.0
"""Host seconds after the fault, or until the process is back, in which a silence begins that follows from it: a robot
stops after 0.75 s without the aggregator."""
_MOVES = 0.01
"""m/s or rad/s."""
_ROBOTS = 4


class Recovery(msgspec.Struct):
    """One fault, in host seconds from the moment of it; for a freeze, from its end."""

    fault: str
    back: float | None
    """Until the process was back, by the launcher's word."""
    stood: int
    """Robots that were not commanded meanwhile, so that they stood."""
    commanded: float
    """Until the last of these was commanded again."""
    moves: float
    """Until the first robot moved, by the ground truth, after the last standstill of all; 0 without one."""


class Motion:
    """When each robot was commanded, and when it moved by the ground truth."""

    def __init__(self, bus: Bus) -> None:
        self.changed = threading.Condition()
        self.moved: dict[int, list[float]] = {robot_id: [] for robot_id in range(_ROBOTS)}
        self.commanded: dict[int, list[float]] = {robot_id: [] for robot_id in range(_ROBOTS)}
        bus.subscribe(names.all_robots_key(names.GROUND_TRUTH), Odometry, self._take)
        bus.subscribe(names.all_robots_key(names.CMD_VEL), Twist, self._take_command)

    def _take_command(self, key: str, _command: Twist) -> None:
        target = names.split_robot_key(key)
        if target is not None:
            with self.changed:
                self.commanded[target[0]].append(monotonic())

    def _take(self, key: str, truth: Odometry) -> None:
        target, twist = names.split_robot_key(key), truth.twist.twist
        if target is not None and max(abs(twist.linear.x), abs(twist.angular.z)) > _MOVES:
            with self.changed:
                self.moved[target[0]].append(monotonic())
                self.changed.notify_all()

    def wait_for_all(self, since: float) -> None:
        """Wait until each robot has moved after host time `since`."""
        with self.changed:
            if not wait_until(self.changed, lambda: all(m and m[-1] > since for m in self.moved.values()), LIMIT):
                standing = [i for i, moved in self.moved.items() if not moved or moved[-1] <= since]
                raise ZteamError(f"robots {standing} do not drive within {LIMIT:g} s")

    def silences(self, since: float, until: float) -> list[float]:
        """Of each robot with a silence between `since` and `until`, the seconds from `since` to the end of the last."""
        with self.changed:
            ends = [_ends(commanded, since, until) for commanded in self.commanded.values()]
        return [each[-1] for each in ends if each]

    def standstill(self, since: float, until: float) -> float:
        """In the same way, the seconds to the end of the last standstill of all robots; 0 without one."""
        with self.changed:
            moments = sorted(moment for moved in self.moved.values() for moment in moved)
        return max(_ends(moments, since, until), default=0.0)


def _ends(moments: Sequence[float], since: float, until: float) -> list[float]:
    """Ends of the silences between these moments that reach into the time from `since` to `until`."""
    silences = [(begin, end) for begin, end in pairwise(moments) if end - begin > _SILENT]
    return [end - since for begin, end in silences if end > since and begin < until]


@contextmanager
def launched(*words: str) -> Iterator[tuple[Launch, Bus, str]]:
    """`zteam up` as the process "up", a session on its router, and the router's endpoint."""
    with launch() as processes:
        processes.start("up", "zteam", "up", *words, environment={"ZTEAM_CONNECT": "", "ZTEAM_NAMESPACE": ""})
        endpoint = processes.wait_for("up", r"router at ([^;\s]+);")[1]
        with closing(connect(BusOptions(connect=endpoint), patience=LIMIT)) as bus:
            yield processes, bus, endpoint


def pid_of(name: str, endpoint: str, bus: Bus) -> int:
    """The process that holds the name, or that is the router."""
    if name == ROUTER:
        record = read_admin(BusOptions(connect=endpoint))
        assert record is not None and record.metadata is not None and record.metadata.pid is not None
        return record.metadata.pid
    return bus.ask(names.info_key(name), ProcessInfo).pid


@contextmanager
def frozen(pid: int) -> Iterator[None]:
    """The process stands still meanwhile."""
    os.kill(pid, signal.SIGSTOP)
    try:
        yield
    finally:
        os.kill(pid, signal.SIGCONT)


def measure_recovery(faults: Sequence[str], lockstep: bool, say: Callable[[str], None]) -> list[Recovery]:
    """Each fault in a team of its own: four robots that drive in a line, in real time or in lock-step at its speed."""
    found = []
    for fault in faults:
        say(fault)
        found.append(_measure(fault, ["--lockstep", "--speed", "1"] if lockstep else []))
    return found


def _measure(fault: str, words: Sequence[str]) -> Recovery:
    name, back = names.SIMULATOR if fault == FROZEN else fault, None
    with launched("line", "restart=on-failure", "--view", "--no-browser", *words) as (processes, bus, endpoint):
        motion = Motion(bus)
        processes.wait_for("up", "the view is at")
        motion.wait_for_all(monotonic() + 1.0)
        pid, line = pid_of(name, endpoint, bus), len(processes.lines["up"])
        if fault == FROZEN:
            with frozen(pid):
                pause(_FREEZE)
                begin = monotonic()
        else:
            begin = monotonic()
            os.kill(pid, signal.SIGKILL)
            back = float(processes.wait_for("up", rf"\b{name} is back after ([\d.]+) s", line)[1])
        # Later silences are chance: the machine may be busy.
        until = begin + max(back or 0.0, _LATEST)
        motion.wait_for_all(until + _LATEST)
        silences, standstill = motion.silences(begin, until), motion.standstill(begin, until)
        return Recovery(fault, back, len(silences), max(silences, default=0.0), standstill)


def format_recovery(found: Sequence[Recovery]) -> str:
    """One row a fault."""
    rows = [
        (
            row.fault,
            "-" if row.back is None else f"{row.back:.1f} s",
            str(row.stood),
            f"{row.commanded:.2f} s",
            f"{row.moves:.2f} s",
        )
        for row in found
    ]
    return format_table(("killed", "back after", "robots that stood", "all commanded after", "moves after"), rows)
