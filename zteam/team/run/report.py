"""The report of a run, which `zteam up --report` writes."""

import os
import tempfile
from collections import Counter
from pathlib import Path
from typing import TypeVar

import msgspec

from zteam import names
from zteam.bus import Bus
from zteam.bus.receiving import KeyCount
from zteam.clock import HOST_FACTOR, monotonic
from zteam.config.numbers import counted, format_factor
from zteam.errors import UsageError, ZteamError
from zteam.node.launcher import Restarted, restarts_text
from zteam.node.lockstep import RoundTiming
from zteam.robot.client import SAFETY, SafetyReply
from zteam.simulator.client import RunFigures, SimReport
from zteam.team.chaos.carry_out import ChaosReport
from zteam.team.launch.process import PROC, ProcessReport

S = TypeVar("S")


class RunReport(RunFigures, kw_only=True):
    """A whole run: the simulator's figures, and what the launcher measured."""

    wall_seconds: float = 0.0
    """From the command's start to the last tick."""
    go_after_seconds: float | None = None
    """From the command's start to GO."""
    processes: list[ProcessReport] = msgspec.field(default_factory=list)
    dropped: dict[str, int] = msgspec.field(default_factory=dict)
    """Refused payloads by key, over all processes."""
    rounds: dict[str, RoundTiming] = msgspec.field(default_factory=dict)
    """Where the participants' time of a tick went, by name (lock-step)."""
    safety_stops: dict[str, int] = msgspec.field(default_factory=dict)
    """How often the safety layer stopped or slowed a robot, by the robot's name."""
    restarts: dict[str, int] = msgspec.field(default_factory=dict)
    """How often processes, or nodes in this process, were started again, by name."""
    recovery_seconds: dict[str, float] = msgspec.field(default_factory=dict)
    """Host seconds until those were back, the longest of each, by name."""
    chaos: ChaosReport | None = None
    """How the team took faults on purpose (`--chaos`)."""


_ANSWER_LIMIT = 15.0 * HOST_FACTOR
"""Host seconds for an answer: a frozen process may go on. One that has ended is not waited for."""
_IMPORTED = monotonic()


def seconds_since_start() -> float:
    """Host seconds since this process was started, imports included; without /proc, since this module was imported."""
    try:
        ticks = int((PROC / "self" / "stat").read_text().rpartition(")")[2].split()[19])
        uptime = float((PROC / "uptime").read_text().split()[0])
    except OSError:
        return monotonic() - _IMPORTED
    return uptime - ticks / os.sysconf("SC_CLK_TCK")


def read_report(bus: Bus) -> RunReport:
    """What every process counted; the launcher adds the rest. Raises BusError when the simulator does not answer."""
    simulator = bus.ask(names.service_key(names.SIMULATOR, "report"), SimReport, timeout=_ANSWER_LIMIT)
    report = RunReport(**{name: getattr(simulator, name) for name in RunFigures.__struct_fields__})
    dropped = Counter[str]()
    for _, counts in _read_all(bus, "stats", dict[str, KeyCount]):
        dropped.update({key: count.dropped for key, count in counts.items()})
    report.dropped = dict(sorted((+dropped).items()))
    report.safety_stops = {name: reply.stops for name, reply in _read_all(bus, SAFETY, SafetyReply)}
    if simulator.lockstep:
        report.rounds = dict(_read_all(bus, "timing", RoundTiming))
    return report


def _read_all(bus: Bus, service: str, kind: type[S]) -> list[tuple[str, S]]:
    """The answers of every process that answers, with its name."""
    answers = bus.query(names.service_key("*", service), kind, timeout=_ANSWER_LIMIT)
    return [(key.partition("/")[0], answer) for key, answer in answers]


def check_writable(path: Path) -> None:
    """Raise UsageError before the run if the report cannot be written after it."""
    try:
        if not path.exists():
            tempfile.TemporaryFile(dir=path.parent).close()
        elif path.is_dir() or not os.access(path, os.W_OK):
            path.open("ab").close()
    except OSError as error:
        raise UsageError(f"--report {path}: cannot write: {error.strerror or error}; name another file") from None


def write_report(path: Path, text: bytes) -> None:
    """Raises ZteamError."""
    try:
        path.write_bytes(text)
    except OSError as error:
        raise ZteamError(f"--report {path}: cannot write: {error.strerror or error}") from None


def format_report(report: RunReport) -> str:
    factor = report.real_time_factor
    pace = "" if factor is None else f", {format_factor(factor)} x real time"
    lines = [f"{counted(report.sim_seconds, 'simulated second')} after GO, seed {report.seed}{pace}"]
    lines.append("robot    follows  driven, m  last gap, m  stalls  safety stops  late steps")
    for robot in report.robots:
        follows = "-" if robot.follow is None else str(robot.follow)
        gap = "-" if robot.gap_m is None else f"{robot.gap_m.end:.2f}"
        stops = report.safety_stops.get(names.robot_name(robot.id), "-")
        row = f"{robot.id:<8}{follows:>8}{robot.distance_m:>11.2f}{gap:>13}{robot.stalls:>8}{stops:>14}"
        lines.append(f"{row}{robot.late_steps:>12}")
    if report.lockstep:
        lines.append(f"lock-step: trajectory {report.trajectory_sha256}")
    seconds = report.recovery_seconds
    restarted = {name: Restarted(count, seconds.get(name)) for name, count in report.restarts.items()}
    lines += [restarts_text(restarted)] if restarted else []
    memory = sum(p.pss_mb for p in report.processes)
    lines.append(f"{counted(len(report.processes), 'process', 'processes')}, {memory:.0f} MB together (PSS)")
    return "\n".join(lines)
