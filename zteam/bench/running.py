"""A whole team in real time: what `zteam up` reports, boiled down to the figures that matter."""

import subprocess
import tempfile
from pathlib import Path

import msgspec

from zteam.errors import ZteamError
from zteam.launch.process import zteam_command
from zteam.launch.report import RunReport


class TeamFigures(msgspec.Struct):
    """One run."""

    robots: int
    go_after_seconds: float | None
    latency_p50_ms: float | None
    """Scan sent to command received, in the simulator."""
    latency_p99_ms: float | None
    late_steps: int
    pss_mb: float
    """Of all processes together, each at its peak."""
    cpu_seconds: dict[str, float]
    dropped: int


def measure_team(team: str, world: str | None, seconds: float) -> TeamFigures:
    """Run a team for `seconds` after GO. Raises ZteamError with its last lines if it fails."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "report.json"
        arguments = [team, "--for", str(seconds), "--report", str(path), *(["--world", world] if world else [])]
        done = subprocess.run(
            zteam_command("up", *arguments),
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=seconds * 10 + 120,
            check=False,
        )
        if done.returncode != 0:
            raise ZteamError(f"the run failed: {' | '.join((done.stdout + done.stderr).splitlines()[-3:])}")
        report = msgspec.json.decode(path.read_bytes(), type=RunReport)
    return TeamFigures(
        robots=len(report.robots),
        go_after_seconds=report.go_after_seconds,
        latency_p50_ms=report.latency_ms["p50"],
        latency_p99_ms=report.latency_ms["p99"],
        late_steps=sum(robot.late_steps for robot in report.robots),
        pss_mb=round(sum(process.pss_mb for process in report.processes), 1),
        cpu_seconds={process.name: process.cpu_seconds for process in report.processes},
        dropped=sum(report.dropped.values()),
    )
