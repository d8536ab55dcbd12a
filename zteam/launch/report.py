"""The report of a run, which `zteam up --report` writes."""

import errno
import os
import tempfile
from collections.abc import Iterable, Mapping
from pathlib import Path

import msgspec

from zteam import names
from zteam.bus import Bus
from zteam.bus.receiving import KeyCount
from zteam.clock import HOST_FACTOR, monotonic
from zteam.errors import UsageError, ZteamError
from zteam.launch.process import PROC, Process, Usage, measure_usage
from zteam.numbers import counted, format_factor
from zteam.resources import is_folder
from zteam.runtime.lockstep import RoundTiming
from zteam.services.simulator import RunFigures, SimReport


class ProcessReport(msgspec.Struct):
    """One process of the run; memory at its peak."""

    name: str
    pid: int
    exit: int | None
    restarts: int
    rss_mb: float
    pss_mb: float
    cpu_seconds: float


class RunReport(RunFigures, kw_only=True):
    """A whole run: the simulator's figures, and what the launcher measured."""

    wall_seconds: float
    """From the command's start to the last tick."""
    go_after_seconds: float | None
    """From the command's start to GO."""
    processes: list[ProcessReport]
    dropped: dict[str, int]
    """Refused payloads by key, over all processes."""
    real_time_factor: float | None = msgspec.field(default=None, name="rtf")
    """Simulated seconds a second of the host, from GO to the last tick."""
    rounds: dict[str, RoundTiming] = msgspec.field(default_factory=dict)
    """Where the participants' time of a tick went, by name (lock-step)."""
    restarts: dict[str, int] = msgspec.field(default_factory=dict)
    """How often processes, or nodes in this process, were started again, by name."""


class Counts(msgspec.Struct, frozen=True):
    """What the processes of a team counted during a run."""

    simulator: SimReport
    dropped: dict[str, int]
    rounds: dict[str, RoundTiming]


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


def read_sim_report(bus: Bus) -> SimReport:
    """The simulator's count. Raises BusError when the simulator does not answer."""
    return bus.ask(names.service_key(names.SIMULATOR, "report"), SimReport, timeout=_ANSWER_LIMIT)


def read_counts(bus: Bus) -> Counts:
    """The counts of every process. Raises BusError when the simulator does not answer."""
    simulator = read_sim_report(bus)
    return Counts(simulator, read_dropped(bus), read_rounds(bus) if simulator.lockstep else {})


def make_report(
    counts: Counts,
    wall_seconds: float,
    go_after: float | None,
    processes: list[ProcessReport],
    restarts: Mapping[str, int],
    hung: Iterable[str] = (),
) -> RunReport:
    """The report of a run. `wall_seconds` and `go_after` are host seconds since the command's start.

    `hung` are the processes with a step that did not return, besides those that lock-step left behind.
    """
    figures = {name: getattr(counts.simulator, name) for name in RunFigures.__struct_fields__}
    figures["hung"] = list(dict.fromkeys((*counts.simulator.hung, *hung)))
    return RunReport(
        **figures,
        wall_seconds=round(wall_seconds, 3),
        go_after_seconds=None if go_after is None else round(go_after, 3),
        processes=processes,
        restarts=dict(restarts),
        dropped=counts.dropped,
        rounds=counts.rounds,
    )


def read_rounds(bus: Bus) -> dict[str, RoundTiming]:
    """Every participant's own timing."""
    answers = bus.query(names.service_key("*", "timing"), RoundTiming, timeout=_ANSWER_LIMIT)
    return {key.partition("/")[0]: timing for key, timing in answers}


def read_dropped(bus: Bus) -> dict[str, int]:
    """Refused payloads by key, summed over every process that answers."""
    dropped: dict[str, int] = {}
    for _, counts in bus.query(names.stats_key("*"), dict[str, KeyCount], timeout=_ANSWER_LIMIT):
        for key, count in counts.items():
            if count.dropped:
                dropped[key] = dropped.get(key, 0) + count.dropped
    return dict(sorted(dropped.items()))


def report_processes(processes: Mapping[str, Process], restarts: Mapping[str, int]) -> list[ProcessReport]:
    """One row for every child: the newest of its name, and how often it was started again."""
    return [_row(p.name, p.pid, p.exit_code, p.usage, restarts.get(p.name, 0)) for p in processes.values()]


def measure_processes(pids: Mapping[str, int]) -> list[ProcessReport]:
    """One row for every other process, by name: its present usage."""
    found = []
    for name, pid in pids.items():
        usage = Usage()
        measure_usage(pid, usage)
        found.append(_row(name, pid, 0, usage, 0))
    return found


def _row(name: str, pid: int, code: int | None, usage: Usage, restarts: int) -> ProcessReport:
    memory = round(usage.rss_mb, 1), round(usage.pss_mb, 1)
    return ProcessReport(name, pid, code, restarts, *memory, round(usage.cpu_seconds, 2))


def check_writable(path: Path) -> None:
    """Raise UsageError before the run if the report cannot be written after it."""
    if is_folder(path):
        raise UsageError(f"--report {path}: that is a folder; name a file in it")
    if not is_folder(path.parent):
        raise UsageError(f"--report {path}: there is no folder {path.parent}; make it first")
    try:
        if not path.exists():
            tempfile.TemporaryFile(dir=path.parent).close()
        elif not os.access(path, os.W_OK):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
    except OSError as error:
        raise UsageError(f"--report {path}: cannot write: {error.strerror or error}; name another file") from None


def write_report(path: Path, text: bytes) -> None:
    """Write the whole of `text`, or nothing: on a failure an older file stays as it was. Raises ZteamError."""
    path = path.resolve()
    try:
        if path.exists() and not (path.is_file() and os.access(path.parent, os.W_OK)):
            # A device or a pipe must not be replaced by a file, and a read-only folder takes no further file.
            path.write_bytes(text)
            return
        part = path.with_name(f".{path.name}.{os.getpid()}")
        try:
            part.write_bytes(text)
            part.replace(path)
        finally:
            part.unlink(missing_ok=True)
    except OSError as error:
        raise ZteamError(f"--report {path}: cannot write: {error.strerror or error}") from None


def format_report(report: RunReport) -> str:
    """A short table for a reader."""
    factor = report.real_time_factor
    pace = "" if factor is None else f", {format_factor(factor)} x real time"
    lines = [f"{counted(report.sim_seconds, 'simulated second')} after GO, seed {report.seed}{pace}"]
    lines.append(f"{'robot':8}{'follows':>8}{'driven, m':>11}{'last gap, m':>13}{'stalls':>8}{'late steps':>12}")
    for robot in report.robots:
        follows = "-" if robot.follow is None else str(robot.follow)
        gap = "-" if robot.gap_m is None else f"{robot.gap_m.end:.2f}"
        row = f"{robot.id:<8}{follows:>8}{robot.distance_m:>11.2f}{gap:>13}{robot.stalls:>8}{robot.late_steps:>12}"
        lines.append(row)
    if report.lockstep:
        lines.append(f"lock-step: trajectory {report.trajectory_sha256}")
    restarted = [f"{name} {counted(count, 'time')}" for name, count in sorted(report.restarts.items())]
    if restarted:
        lines.append(f"started again: {', '.join(restarted)}")
    memory = sum(p.pss_mb for p in report.processes)
    lines.append(f"{counted(len(report.processes), 'process', 'processes')}, {memory:.0f} MB together (PSS)")
    return "\n".join(lines)
