"""A team of processes under random faults for a long time: how it recovers, and whether anything leaks or grows."""

import os
import subprocess
import tempfile
import threading
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from contextlib import closing
from pathlib import Path

import msgspec

from zteam import names
from zteam.bus import Bus, BusOptions, connect
from zteam.bus.presence import find_processes
from zteam.bus.router import read_admin
from zteam.clock import monotonic
from zteam.config.fault import KINDS
from zteam.config.resources import find_team
from zteam.config.toml_values import toml_text
from zteam.errors import ZteamError
from zteam.monitor.observer import TeamObserver
from zteam.node.kinds import ROUTER
from zteam.team.chaos.carry_out import Outcome, Violation, Watchdog
from zteam.team.chaos.plan import plan_text, random_plan
from zteam.team.file.reading import read_team_file
from zteam.team.launch.process import PROC, zteam_command
from zteam.team.run.report import RunReport

_EARLY, _LOOKS = 2, 20
"""What the processes hold is looked at so often, at equal distances; this look counts as early."""
_PATIENCE = 120.0
"""Host seconds without progress after which the run is given up."""
SLOW = 1.5
"""Host seconds within which a team is to recover from a fault."""


class Footprint(msgspec.Struct):
    """What a process holds."""

    pid: int
    mb: float
    """Its own memory, 10⁶ bytes: what is not of a file."""
    descriptors: int


class Held(msgspec.Struct):
    """What a process held early in the run and at its end. `same` says whether it was the same process."""

    same: bool
    mb: tuple[float, float]
    descriptors: tuple[int, int]


class FaultFigures(msgspec.Struct):
    """One run under random faults."""

    team: str
    seed: int
    lockstep: bool
    sim_seconds: float
    wall_seconds: float
    exit_code: int
    faults: dict[str, int]
    """Carried out, by kind."""
    problems: dict[str, int]
    """Those that were not carried out, or from which the team did not recover in time, by what was said."""
    recovery_p50: float | None
    """Host seconds."""
    recovery_max: float | None
    slow: list[Outcome]
    """Those that took longer than `SLOW`."""
    violations: list[Violation]
    """Each truth in which a robot moved longer than the watchdog allows."""
    restarts: dict[str, int]
    hung: list[str]
    """What lock-step left behind. It makes the exit code 1."""
    crashed: list[str]
    """Processes that ended by an error or a signal that the plan did not send."""
    left_processes: list[str]
    left_files: list[str]
    held: dict[str, Held]
    """By process."""
    growth: float
    """Largest growth of the memory of a process that was not started again, as a share."""


def measure_faults(team: str, seed: int, seconds: float, speed: str | None, say: Callable[[str], None]) -> FaultFigures:
    """Drive a team under the faults that a seed draws. Raises ZteamError if the run does not get to its end."""
    robots = read_team_file(find_team(team)).team.robots
    processes = [
        names.SIMULATOR, names.AGGREGATOR, names.MONITOR, ROUTER, *(names.robot_name(robot.id) for robot in robots),
    ]  # fmt: skip
    with tempfile.TemporaryDirectory(prefix="faults_") as place:
        folder, mark = Path(place), f"faults_{os.getpid()}_{seed}"
        (folder / "tmp").mkdir()
        # What fails is started again, whatever the team file says.
        (folder / "team.toml").write_text(
            f'include = [{toml_text(str(find_team(team).resolve()))}]\n[team]\nrestart = "on-failure"\n'
        )
        (folder / "plan.toml").write_text(plan_text(random_plan(seed, seconds, processes)))
        pace = ("--speed", speed) if speed is not None else ("--lockstep", "--lockstep-timeout", "60")
        command = zteam_command(
            "zteam", "up", str(folder / "team.toml"), "--for", str(seconds), "--chaos", str(folder / "plan.toml"),
            "--report", str(folder / "run.json"), *pace,
        )  # fmt: skip
        environment = {
            **os.environ, "TMPDIR": str(folder / "tmp"), "HOME": str(folder / "tmp"), "ZTEAM_NAMESPACE": mark,
        }  # fmt: skip
        begin = monotonic()
        with _Up(command, environment) as up:
            early, late = _watch(up, mark, processes, seconds, lockstep=speed is None, say=say)
            code = up.process.wait(_PATIENCE)
        wall = monotonic() - begin
        left = _marked(mark)
        files = [path.name for path in (folder / "tmp").rglob("*") if path.is_file()]
        report = msgspec.json.decode((folder / "run.json").read_bytes(), type=RunReport)
    return _figures(team, seed, code, wall, report, early, late, left, files, up.crashed, speed)


class _Up:
    """`zteam up` with its output read."""

    def __init__(self, command: list[str], environment: dict[str, str]) -> None:
        self.process = subprocess.Popen(
            command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace"
        )
        self.endpoint = ""
        self.crashed: list[str] = []
        self.last = ""
        self.listens, self.ended = threading.Event(), threading.Event()
        self._reader = threading.Thread(target=self._read, name="read up", daemon=True)
        self._reader.start()

    def __enter__(self) -> "_Up":
        return self

    def __exit__(self, *_: object) -> None:
        if self.process.poll() is None:
            self.process.terminate()
            self.process.wait(_PATIENCE)
        self._reader.join()

    def _read(self) -> None:
        assert self.process.stdout is not None
        with self.process.stdout as lines:
            for line in lines:
                self.last = line.strip() or self.last
                if not self.endpoint and ": router at " not in line and " router at " in line:
                    self.endpoint = line.partition(" router at ")[2].partition(";")[0].partition(",")[0].strip()
                    self.listens.set()
                # The plan kills with SIGKILL.
                if " ended: " in line and "SIGKILL" not in line:
                    self.crashed.append(line.strip())
        self.listens.set()
        self.ended.set()


def _watch(
    up: _Up, mark: str, processes: Iterable[str], seconds: float, *, lockstep: bool, say: Callable[[str], None]
) -> tuple[dict[str, Footprint], dict[str, Footprint]]:
    """What the processes hold early in the run, and at its end."""
    up.listens.wait(_PATIENCE)
    if not up.endpoint:
        raise ZteamError(f"the team did not start: {up.last}")
    options = BusOptions(connect=up.endpoint, namespace=mark)
    with closing(connect(options, patience=_PATIENCE)) as bus:
        watchdog = Watchdog(TeamObserver(bus), lockstep=lockstep)
        found = []
        for look in range(1, _LOOKS):
            while (seen := watchdog.elapsed) < look * seconds / _LOOKS and not up.ended.is_set():
                say(f"{seen:.0f} of {seconds:.0f} simulated seconds")
                if not _waits(watchdog, seen, up):
                    raise ZteamError(f"simulated time stands still at {seen:.1f} s: {up.last}")
            found.append(_footprints(_pids(bus, options), [*processes, names.LAUNCHER]))
    # A process that is being started again in the last look is that of the one before.
    early, late = found[:_EARLY], found[_EARLY:]
    return {k: v for each in early for k, v in each.items()}, {k: v for each in late for k, v in each.items()}


def _waits(watchdog: Watchdog, seen: float, up: _Up) -> bool:
    """Whether simulated time goes on, or the run has ended."""
    deadline = monotonic() + _PATIENCE
    while watchdog.elapsed == seen and not up.ended.is_set() and monotonic() < deadline:
        with watchdog.team.changed:
            # The end of the run is no news on the bus.
            watchdog.team.changed.wait_for(lambda: watchdog.elapsed > seen, 1.0)
    return watchdog.elapsed > seen or up.ended.is_set()


def _pids(bus: Bus, options: BusOptions) -> dict[str, int]:
    """The process ids of a team of this host, by name: only looked at, because a sender may say any."""
    admin = read_admin(options)
    router = {ROUTER: admin.metadata.pid} if admin and admin.metadata and admin.metadata.pid else {}
    return {info.name: info.pid for info in find_processes(bus)} | router


def _footprints(pids: Mapping[str, int], processes: Iterable[str]) -> dict[str, Footprint]:
    found = {}
    for name in processes:
        try:
            pid = pids[name]
            status = (PROC / str(pid) / "status").read_text()
            descriptors = len(list((PROC / str(pid) / "fd").iterdir()))
        except (KeyError, OSError):
            # It is being started again, or is paused.
            continue
        own = next(int(line.split()[1]) for line in status.splitlines() if line.startswith("RssAnon:"))
        found[name] = Footprint(pid, own * 1024 / 1e6, descriptors)
    return found


def _marked(mark: str) -> list[str]:
    """Processes that run in the namespace `mark`, but for this one."""
    found = []
    for folder in PROC.glob("[0-9]*"):
        try:
            if f"ZTEAM_NAMESPACE={mark}".encode() in (folder / "environ").read_bytes().split(b"\0"):
                found.append(f"{folder.name} {(folder / 'comm').read_text().strip()}")
        except OSError:
            # It has ended, or is another user's.
            continue
    return found


def _figures(
    team: str,
    seed: int,
    code: int,
    wall: float,
    report: RunReport,
    early: dict[str, Footprint],
    late: dict[str, Footprint],
    left: list[str],
    files: list[str],
    crashed: list[str],
    speed: str | None,
) -> FaultFigures:
    assert report.chaos is not None
    done = [each for each in report.chaos.faults if not each.problem]
    held = {
        name: Held(
            early[name].pid == late[name].pid,
            (round(early[name].mb, 2), round(late[name].mb, 2)),
            (early[name].descriptors, late[name].descriptors),
        )
        for name in early
        if name in late
    }
    growths = [each.mb[1] / each.mb[0] - 1.0 for each in held.values() if each.same]
    times = report.chaos.recoveries
    return FaultFigures(
        team,
        seed,
        speed is None,
        report.sim_seconds,
        round(wall, 1),
        code,
        {kind: sum(each.fault == kind for each in done) for kind in KINDS},
        dict(Counter(each.problem for each in report.chaos.faults if each.problem)),
        round(times[len(times) // 2], 3) if times else None,
        round(times[-1], 3) if times else None,
        [each for each in report.chaos.faults if (each.recovery or 0.0) > SLOW],
        report.chaos.violations,
        report.restarts,
        report.hung,
        crashed,
        left,
        files,
        held,
        round(max(growths, default=0.0), 4),
    )
