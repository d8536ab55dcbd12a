"""A team of processes under random faults for a long time: how it recovers, and whether anything leaks or grows."""

import os
import tempfile
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import closing
from pathlib import Path

import msgspec

from studies.launching import launch
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
from zteam.team.chaos.means import plan_text, random_plan
from zteam.team.file.reading import read_team_file
from zteam.team.launch.process import PROC, Process
from zteam.team.run.report import RunReport

_EARLY, _LATE = 0.1, 0.95
"""Shares of the run after which it is looked at what the processes hold."""
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

    @classmethod
    def of(cls, early: Footprint, late: Footprint) -> "Held":
        """Both looks at a process."""
        mb = (round(early.mb, 2), round(late.mb, 2))
        return cls(early.pid == late.pid, mb, (early.descriptors, late.descriptors))


class FaultFigures(msgspec.Struct):
    """One run under random faults."""

    team: str
    seed: int
    lockstep: bool
    sim_seconds: float
    wall_seconds: float
    exit_code: int | None
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
        home = folder / "tmp"
        home.mkdir()
        # What fails is started again, whatever the team file says.
        (folder / "team.toml").write_text(
            f'include = [{toml_text(str(find_team(team).resolve()))}]\n[team]\nrestart = "on-failure"\n'
        )
        (folder / "plan.toml").write_text(plan_text(random_plan(seed, seconds, processes)))
        pace = ("--speed", speed) if speed is not None else ("--lockstep", "--lockstep-timeout", "60")
        words = [
            str(folder / "team.toml"), "--for", str(seconds), "--chaos", str(folder / "plan.toml"),
            "--report", str(folder / "run.json"), *pace,
        ]  # fmt: skip
        environment = {"TMPDIR": str(home), "HOME": str(home), "ZTEAM_NAMESPACE": mark}
        begin = monotonic()
        with launch() as running:
            up = running.start("up", "zteam", "up", *words, environment=environment)
            endpoint = running.wait_for("up", r"router at ([^;\s]+);")[1]
            options = BusOptions(connect=endpoint, namespace=mark)
            early, late = _watch(up, options, processes, seconds, lockstep=speed is None, say=say)
            running.supervisor.wait(lambda: not up.running, _PATIENCE)
            up.join(_PATIENCE)
            # The plan kills with SIGKILL.
            crashed = [line.strip() for line in running.lines["up"] if " ended: " in line and "SIGKILL" not in line]
        wall = monotonic() - begin
        report = msgspec.json.decode((folder / "run.json").read_bytes(), type=RunReport)
        left = [path.name for path in home.rglob("*") if path.is_file()]
    assert report.chaos is not None
    done, times = [each for each in report.chaos.faults if not each.problem], report.chaos.recoveries
    held = {name: Held.of(early[name], late[name]) for name in early if name in late}
    growths = [each.mb[1] / each.mb[0] - 1.0 for each in held.values() if each.same]
    return FaultFigures(
        team=team,
        seed=seed,
        lockstep=speed is None,
        sim_seconds=report.sim_seconds,
        wall_seconds=round(wall, 1),
        exit_code=up.exit_code,
        faults={kind: sum(each.fault == kind for each in done) for kind in KINDS},
        problems=dict(Counter(each.problem for each in report.chaos.faults if each.problem)),
        recovery_p50=round(times[len(times) // 2], 3) if times else None,
        recovery_max=round(times[-1], 3) if times else None,
        slow=[each for each in report.chaos.faults if (each.recovery or 0.0) > SLOW],
        violations=report.chaos.violations,
        restarts=report.restarts,
        hung=report.hung,
        crashed=crashed,
        left_processes=_marked(mark),
        left_files=left,
        held=held,
        growth=round(max(growths, default=0.0), 4),
    )


def _watch(
    up: Process, options: BusOptions, processes: Iterable[str], seconds: float, *, lockstep: bool,
    say: Callable[[str], None],
) -> Iterator[dict[str, Footprint]]:  # fmt: skip
    """What the processes hold early in the run, and before its end; not of one that is being started again."""
    with closing(connect(options, patience=_PATIENCE)) as bus:
        watchdog = Watchdog(TeamObserver(bus), lockstep=lockstep)
        for share in (_EARLY, _LATE):
            while (seen := watchdog.elapsed) < share * seconds and up.running:
                say(f"{seen:.0f} of {seconds:.0f} simulated seconds")
                deadline = monotonic() + _PATIENCE
                with watchdog.team.changed:
                    while watchdog.elapsed == seen and up.running:
                        if monotonic() > deadline:
                            raise ZteamError(f"simulated time stands still at {seen:.1f} s: {list(up.lines)[-1:]}")
                        # The end of the run is no news on the bus.
                        watchdog.team.changed.wait_for(lambda: watchdog.elapsed > seen, 1.0)
            yield _footprints(_pids(bus, options), [*processes, names.LAUNCHER])


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
