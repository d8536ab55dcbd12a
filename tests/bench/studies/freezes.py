"""What a line of robots does when one of its processes is frozen for a while, and what the other processes log."""

import re
from collections.abc import Callable, Iterator, Sequence
from itertools import product

import msgspec

from studies.recovery import Motion, frozen, launched, pid_of
from zteam import names
from zteam.cli.tables import format_table
from zteam.clock import monotonic, pause
from zteam.messages import RobotStatus
from zteam.node.kinds import ROUTER

ROBOTS = tuple(names.robot_name(robot_id) for robot_id in range(4))
PROCESSES = (ROUTER, names.SIMULATOR, names.AGGREGATOR, names.MONITOR, *ROBOTS)
SECONDS = (3.0, 10.0, 30.0)
MODES = {"real time": (), "lock-step": ("--lockstep", "--lockstep-timeout", "60", "--speed", "1")}
BACK = 3.0
"""Host seconds after the end of the freeze within which all robots are to drive."""
_BEFORE, _AFTER = 6.0, 8.0
"""Host seconds of driving before the freeze and after it that are looked at."""
_CALLED = {
    names.SIMULATOR: "the simulator",
    names.AGGREGATOR: "the aggregator",
    names.MONITOR: "the monitor",
    ROUTER: "router lost",
}
"""What log lines call the processes that are no robots."""
_OVER = re.compile(r"\b(GO|is back|answers again)\b")
"""Marks a line that reports that something is over."""
_TROUBLE = re.compile(r"is stuck|hands over|drives round|makes room")


class Frozen(msgspec.Struct):
    """One freeze."""

    process: str
    seconds: float
    mode: str
    seed: int
    turned: bool
    """Whether the line was led from its other end, or a robot left its way."""
    drive_after: float
    """Host seconds from the end of the freeze until the last robot drove; infinite if one did not."""
    says_so: bool
    """Whether the frozen process logged that it was frozen (a router logs nothing)."""
    false: list[str]
    """Log lines that accuse a process which was not frozen."""
    lines: list[str]
    """All log lines from the beginning of the freeze on."""

    @property
    def is_good(self) -> bool:
        """Whether the team went on as before."""
        return not self.turned and self.drive_after <= BACK and self.says_so and not self.false


def accuses(line: str, frozen: str) -> bool:
    """Whether a log line such as `[tf] 12:00:00 text` blames a process that was not frozen."""
    speaker, _, text = line.partition("] ")
    speaker = speaker.rpartition("[")[2]
    if _OVER.search(text) or "this process was frozen" in text:
        return False
    is_bad = "warning: " in text or "error: " in text or (speaker == names.MONITOR)
    named = {name for name in ROBOTS if re.search(rf"\b{name}\b", text)}
    named |= {name for name, called in _CALLED.items() if called in text}
    # A line about the process's own keys blames no other process.
    return is_bad and bool(named - {frozen, speaker})


def measure_freezes(
    processes: Sequence[str], seconds: Sequence[float], modes: Sequence[str], seeds: Sequence[int],
    say: Callable[[str], None],
) -> Iterator[Frozen]:  # fmt: skip
    """One team for each process, time, mode and seed."""
    for process, time, mode, seed in product(processes, seconds, modes, seeds):
        say(f"{process} {time:g} s, {mode}, seed {seed}")
        yield measure_freeze(process, time, mode, seed)


def measure_freeze(process: str, seconds: float, mode: str, seed: int) -> Frozen:
    """The shipped line with this process frozen."""
    with launched("line", "--seed", str(seed), *MODES[mode]) as (processes, bus, endpoint):
        motion, turns = Motion(bus), list[int]()
        bus.subscribe(names.all_robots_key(names.STATUS), RobotStatus, lambda _key, status: turns.append(status.turns))
        motion.wait_for_all(monotonic() + 1.0)
        pid = pid_of(process, endpoint, bus)
        pause(_BEFORE)
        line, before = len(processes.lines["up"]), len(turns)
        with frozen(pid):
            pause(seconds)
        end = monotonic()
        pause(_AFTER)
        lines = processes.lines["up"][line:]
        after = {robot: [m - end for m in moved if m > end] for robot, moved in motion.moved.items()}
        return Frozen(
            process, seconds, mode, seed,
            turned=max(turns[before - len(ROBOTS) :]) > max(turns[:before]) or any(map(_TROUBLE.search, lines)),
            drive_after=max(moved[0] if moved else float("inf") for moved in after.values()),
            says_so=process == ROUTER or any(f"[{process}]" in text and "was frozen" in text for text in lines),
            false=[text for text in lines if accuses(text, process)],
            lines=lines,
        )  # fmt: skip


def format_freezes(found: Sequence[Frozen]) -> str:
    """One row a freeze, and the false lines below."""
    rows = [
        (
            row.process,
            f"{row.seconds:g} s",
            row.mode,
            str(row.seed),
            "yes" if row.turned else "no",
            f"{row.drive_after:.1f} s",
            "yes" if row.says_so else "no",
            str(len(row.false)),
        )
        for row in found
    ]
    header = ("frozen", "for", "mode", "seed", "turned", "all drive after", "says so", "false lines")
    false = [f"{row.process} {row.seconds:g} s, {row.mode}: {text}" for row in found for text in row.false]
    good = sum(row.is_good for row in found)
    return "\n".join([format_table(header, rows), *false, f"{good} of {len(found)} went on as before"])
