"""A whole team of real processes through a router: in lock-step as fast as it runs, or in real time."""

import os
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path

import msgspec

from zteam import names
from zteam.bench.chains.run import GAP
from zteam.bench.circuit import Circuit, find_circuit
from zteam.bench.floor import measure_floor
from zteam.bench.hops import measure_hops
from zteam.bench.simulation import measure_simulation
from zteam.errors import ZteamError
from zteam.geometry import Pose2
from zteam.launch.process import zteam_command
from zteam.launch.report import RunReport
from zteam.runtime.participant import RoundTiming
from zteam.services.simulator import Timing
from zteam.simulation_options import Options
from zteam.toml_values import toml_text
from zteam.world import World, add_robot, load_world

FLOOR_SECONDS = 4.0
_ROBOT = """
include {world}
define bench_robot position
(
  size [0.35 0.35 0.25]
  origin [-0.05 0 0 0]
  drive "diff"
  ranger ( pose [0.05 0 -0.1 0] size [0.05 0.05 0.1] sensor ( range [0 30] fov 270.25 samples {beams} ) )
)
"""


class InProcessFigures(msgspec.Struct):
    """The same team in one process, and its parts."""

    rtf: float | None
    """Simulated seconds per host second, from GO on."""
    core_rtf: float
    """Of the simulator's core alone, with as many robots: simulated seconds per CPU second."""
    robot_us: float
    """Microseconds of a robot's step and its answer, on average over robots and ticks."""
    same_trajectory: bool
    """Whether the robots drove as in processes, to the bit."""
    memory_mb: float
    """PSS of the process at its peak."""


class TeamFigures(msgspec.Struct):
    """Figures of one run."""

    world: str
    robots: int
    beams: int
    lockstep: bool
    rtf: float | None
    """Simulated seconds per host second, from GO on."""
    ticks_per_s: float | None
    timing_ms: Timing | None
    """Parts of the simulator's time per tick."""
    rounds: dict[str, RoundTiming]
    """Parts of the participants' time per tick (lock-step)."""
    go_after_seconds: float | None
    latency_p50_ms: float | None
    """From a scan sent to its command received, measured in the simulator."""
    latency_p99_ms: float | None
    lateness_p99_ms: float | None
    """Delay of ticks after the time they were due (real time)."""
    late_steps: int
    resends: int
    trajectory_sha256: str
    pss_mb: float
    """Sum over all processes, each at its peak."""
    cpu_seconds: dict[str, float]
    dropped: int
    least_driven_m: float
    """The way of the robot that drove least."""
    hops_us: dict[str, float] = {}
    """Microseconds of the steps of a tick, each measured alone (zteam.bench.hops)."""
    floor_rtf: float | None = None
    """The same exchange of messages on bare Zenoh (zteam.bench.bare_zenoh), measured right after the run."""
    floor_ratio: float | None = None
    """floor_rtf / rtf; 1 is as fast as the transport alone."""
    in_process: InProcessFigures | None = None
    """The same team in one process, where that was asked for."""


def measure_team(
    world: Path, robots: int, beams: int, seconds: float, *, realtime: bool = False, in_process: bool = False
) -> TeamFigures:
    """Run a line of `robots` robots with lasers of `beams` beams for `seconds` simulated seconds after GO.

    The first drives round and round on a circuit, each other one follows the one before; none ever stands. With
    `in_process` the same team runs a second time, in one process, and the simulator's core alone runs after it. Raises
    UsageError for a world without a circuit, ZteamError with the last lines of a run that fails.
    """
    loaded = load_world(world)
    ways = [[] if realtime else ["--lockstep"], *([["--lockstep", "--in-process"]] if in_process else [])]
    report, *one = _run_line(world, loaded, robots, beams, seconds, ways)
    rtf = report.real_time_factor
    ticks_per_s = None if rtf is None else rtf * 1e9 / loaded.interval
    figures = TeamFigures(
        world=loaded.name, robots=robots, beams=beams, lockstep=report.lockstep, rtf=rtf,
        ticks_per_s=ticks_per_s, timing_ms=report.timing_ms, rounds=report.rounds,
        go_after_seconds=report.go_after_seconds, latency_p50_ms=report.latency_ms.p50,
        latency_p99_ms=report.latency_ms.p99, lateness_p99_ms=report.lateness_p99_ms,
        late_steps=sum(robot.late_steps for robot in report.robots), resends=report.resends,
        trajectory_sha256=report.trajectory_sha256,
        pss_mb=round(sum(process.pss_mb for process in report.processes), 1),
        cpu_seconds={process.name: process.cpu_seconds for process in report.processes},
        dropped=sum(report.dropped.values()), least_driven_m=min(robot.distance_m for robot in report.robots),
    )  # fmt: skip
    if one:
        core = measure_simulation(loaded, robots, beams, 270.25, 30.0, seconds, Options())
        figures.in_process = _in_process(one[0], report, core.rtf)
    if robots > 1:
        model = loaded.robots[0] if loaded.robots else add_robot(loaded, "erratic", Pose2(0.0, 0.0, 0.0), "bench")
        figures.hops_us = measure_hops(model, robots, beams)
    if not realtime and rtf:
        figures.floor_rtf = measure_floor(robots, beams, FLOOR_SECONDS, loaded.interval / 1e9).rtf
        figures.floor_ratio = figures.floor_rtf / rtf
    return figures


def _run_line(
    world: Path, loaded: World, robots: int, beams: int, seconds: float, ways: Sequence[list[str]]
) -> list[RunReport]:
    """Run the same line of robots in several ways, each with further arguments for `zteam up`."""
    with tempfile.TemporaryDirectory() as folder:
        team = _write_line(world, loaded, robots, beams, Path(folder))
        common = [str(team), "--for", str(seconds)]
        return [run_processes([*common, *way], Path(folder), world, seconds) for way in ways]


def write_world(world: Path, beams: int, path: Path) -> None:
    """A world file at `path`: `world`, and the model `bench_robot` with a laser of so many beams."""
    path.write_text(_ROBOT.format(world=msgspec.json.encode(str(world.resolve())).decode(), beams=beams))


def write_line_team(world: Path, robots: int, beams: int, folder: Path) -> Path:
    """A team file in `folder`: a line of robots that drives round and round through the world."""
    return _write_line(world, load_world(world), robots, beams, folder)


def _write_line(world: Path, loaded: World, robots: int, beams: int, folder: Path) -> Path:
    team, changed = folder / "bench.toml", folder / "bench.world"
    circuit = find_circuit(loaded, GAP * (robots - 1))
    write_world(world, beams, changed)
    team.write_text(_team(changed, robots, circuit))
    return team


def _in_process(one: RunReport, many: RunReport, core_rtf: float) -> InProcessFigures:
    acts = [timing.act for name, timing in one.rounds.items() if names.robot_id_of(name) is not None]
    return InProcessFigures(
        rtf=one.real_time_factor,
        core_rtf=core_rtf,
        robot_us=1e3 * sum(acts) / max(1, len(acts)),
        same_trajectory=one.trajectory_sha256 == many.trajectory_sha256,
        memory_mb=round(sum(process.pss_mb for process in one.processes), 1),
    )


def _team(world: Path, robots: int, circuit: Circuit) -> str:
    """The head stands at the beginning of the circuit, the others behind it, each GAP from the one before."""
    lines = ["[team]", f"world = {toml_text(str(world))}", "world_robots = false"]
    head = {"behavior": "path", "waypoints": circuit.waypoints, "loop": True}
    for i in range(robots):
        lines += ["[[robots]]", f"id = {i}", 'model = "bench_robot"', f"pose = {toml_text(circuit.at(-GAP * i))}"]
        lines += [f"{key} = {toml_text(value)}" for key, value in ({"follow": i - 1} if i else head).items()]
    return "\n".join(lines) + "\n"


def run_processes(arguments: list[str], folder: Path, world: Path, seconds: float) -> RunReport:
    """Run `zteam up` with these arguments; files that `world` includes are found beside it. Raises ZteamError."""
    search = os.pathsep.join([str(world.resolve().parent), os.environ.get("STAGEPATH", "")])
    path = folder / "report.json"
    done = subprocess.run(
        zteam_command("zteam", "up", *arguments, "--report", str(path)),
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=seconds * 10 + 180,
        env={**os.environ, "STAGEPATH": search},
        check=False,
    )
    if done.returncode != 0:
        raise ZteamError(f"the run failed: {' | '.join((done.stdout + done.stderr).splitlines()[-3:])}")
    return msgspec.json.decode(path.read_bytes(), type=RunReport)
