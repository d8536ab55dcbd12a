"""What `zteam up --report` writes."""

import os
from pathlib import Path

import msgspec

from zteam import names
from zteam.bus import Bus
from zteam.bus.counters import KeyCount
from zteam.errors import ZteamError
from zteam.launch.process import Process, Usage
from zteam.runtime.participant import RoundTiming
from zteam.services.simulator import RobotReport, SimReport, Timing


class ProcessReport(msgspec.Struct):
    """One process of the run; memory at its peak."""

    name: str
    pid: int
    exit: int | None
    restarts: int
    rss_mb: float
    pss_mb: float
    cpu_seconds: float


class RunReport(msgspec.Struct):
    """A whole run."""

    sim_seconds: float
    """Simulated, from GO on."""
    wall_seconds: float
    """From the command's start to the last tick."""
    go_after_seconds: float | None
    """From the command's start to GO."""
    seed: int
    external_commands: int
    robots: list[RobotReport]
    processes: list[ProcessReport]
    dropped: dict[str, int]
    """Refused payloads by key, over all processes."""
    latency_ms: dict[str, float | int | None]
    """Scan sent to command received, in the simulator: p50, p99, count."""
    ticks: int = 0
    """From GO on."""
    rtf: float | None = None
    """Real-time factor: simulated seconds a second of the host, from GO to the last tick."""
    trajectory_sha256: str = ""
    """Of x, y, yaw of every robot in every tick from GO on; the same for the same seed in lock-step."""
    lockstep: bool = False
    resends: int = 0
    """Ticks that had to be sent again in lock-step."""
    hung: list[str] = []
    """Participants that lock-step left behind."""
    timing_ms: Timing | None = None
    """Where a tick's time went, on average."""
    lateness_p99_ms: float | None = None
    """Ticks that began after they were due."""
    rounds: dict[str, RoundTiming] = {}
    """Where the participants' time of a tick went, by name (lock-step)."""


def seconds_since_start() -> float:
    """Host seconds since this process was started, interpreter and imports included."""
    ticks = int(Path("/proc/self/stat").read_text().rpartition(")")[2].split()[19])
    uptime = float(Path("/proc/uptime").read_text().split()[0])
    return uptime - ticks / os.sysconf("SC_CLK_TCK")


def read_sim_report(bus: Bus) -> SimReport:
    """The simulator's own count. Raises BusError when it does not answer."""
    return bus.ask(names.service_key(names.SIMULATOR, "report"), SimReport)


def read_rounds(bus: Bus) -> dict[str, RoundTiming]:
    """Every participant's own timing."""
    answers = bus.query(names.service_key("*", "timing"), RoundTiming)
    return {key.partition("/")[0]: timing for key, timing in answers}


def read_dropped(bus: Bus) -> dict[str, int]:
    """Refused payloads by key, summed over every process that answers."""
    dropped: dict[str, int] = {}
    for _, counts in bus.query(names.stats_key("*"), dict[str, KeyCount]):
        for key, count in counts.items():
            if count.dropped:
                dropped[key] = dropped.get(key, 0) + count.dropped
    return dict(sorted(dropped.items()))


def report_processes(processes: dict[str, Process], launcher: str, own: Usage) -> list[ProcessReport]:
    """Every child, and this process, which took `own`, under the name `launcher`."""
    found = [_row(p.name, p.pid, p.exit_code, p.usage) for p in processes.values()]
    return [*found, _row(launcher, os.getpid(), 0, own)]


def _row(name: str, pid: int, code: int | None, usage: Usage) -> ProcessReport:
    memory = round(usage.rss_mb, 1), round(usage.pss_mb, 1)
    # Nothing is ever started again by itself, so there is nothing to count yet.
    return ProcessReport(name, pid, code, 0, *memory, round(usage.cpu_seconds, 2))


def write_report(path: Path, text: bytes) -> None:
    """Write the whole of `text`, or nothing: a file that stood there stays. Raises ZteamError where it cannot."""
    path = path.resolve()
    try:
        if path.exists() and not (path.is_file() and os.access(path.parent, os.W_OK)):
            # A device or a pipe, whose place nothing may take, or a folder that takes no further file.
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
    """A short table for people."""
    pace = "" if report.rtf is None else f", {report.rtf:.3g} x real time"
    lines = [f"{report.sim_seconds:.1f} simulated seconds after GO, seed {report.seed}{pace}"]
    lines.append(f"{'robot':8}{'follows':>8}{'driven m':>10}{'gap end m':>10}{'stalls':>8}{'late':>6}")
    for robot in report.robots:
        follows = "-" if robot.follow is None else str(robot.follow)
        gap = "-" if robot.gap_m is None else f"{robot.gap_m.end:.2f}"
        row = f"{robot.id:<8}{follows:>8}{robot.distance_m:>10.2f}{gap:>10}{robot.stalls:>8}{robot.late_steps:>6}"
        lines.append(row)
    if report.lockstep:
        lines.append(f"lock-step: trajectory {report.trajectory_sha256}")
    memory = sum(p.pss_mb for p in report.processes)
    lines.append(f"{len(report.processes)} processes, {memory:.0f} MB together (PSS)")
    return "\n".join(lines)
