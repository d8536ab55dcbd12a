"""What `zteam bench` measures: a team of real processes, in lock-step as fast as it runs or in real time, and the core.

The core is the simulator's, alone, as fast as it runs: wandering robots that start at seeded free poses.
"""

import math
import os
import resource
import subprocess
import tempfile
from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import NDArray

from zteam import names
from zteam.clock import process_time
from zteam.config.map_files import OCCUPIED
from zteam.config.simulation_options import Options
from zteam.config.toml_values import toml_text
from zteam.counter_random import uniform
from zteam.errors import UsageError, ZteamError
from zteam.geometry import Pose2
from zteam.messages import Twist, Vector3
from zteam.navigation.planning.costmap import INSCRIBED_INFLATED_OBSTACLE, CostmapOptions, make_circle, make_costmap
from zteam.navigation.planning.maps import map_grid
from zteam.navigation.planning.planner import AStarPlanner, NoPathError
from zteam.node.lockstep import RoundTiming
from zteam.robot.behaviors.path import Polyline
from zteam.simulator.client import Timing
from zteam.simulator.core import Engine
from zteam.simulator.core.occupancy_grid import map_message
from zteam.simulator.world import Ranger, Robot, World, add_robot, load_world
from zteam.simulator.world.placing import REACH, find_bounds, find_hindrance
from zteam.team.launch.process import zteam_command
from zteam.team.run.report import RunReport

GAP = 0.8
"""Metres along the way between neighbours at the start."""
CLEARANCE = 0.35
"""Metres to the next wall that a circuit keeps; an erratic's corner is 0.285 m from its base."""
APART = 1.2
"""Metres between two parts of a circuit, at least."""
WINDOW = 1.0
"""Metres over which a circuit is smoothed: its bends have a radius of about half of that."""
_CELL, _STEP = 0.1, 0.02
"""Metres: a cell of the map, and between the points of a smooth way."""
_NEAR = 4.0
"""Metres along a circuit within which two places are in the same part."""
_SPARE = 8.0
"""Metres from the head of a chain to its last robot, which drives ahead of it, at least."""
_DRAWS, _CHOICES = 400, 3
"""How often two places are drawn; circuits that are found, of which the longest is taken."""
_SEED = 1
_TURN_TICKS = 20
"""Ticks after which a wandering robot chooses a new turn rate."""
Floats = NDArray[np.float64]
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


class SimulationFigures(msgspec.Struct):
    """Figures per CPU second of this process, which other load affects little."""

    robots: int
    beams: int
    seconds: float
    rtf: float
    """Simulated seconds per CPU second."""
    rays_per_s: float
    step_ms: float
    rss_mb: float
    """Peak resident memory of the process, 10⁶ bytes."""


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
    with tempfile.TemporaryDirectory() as name:
        common = [str(write_line_team(world, robots, beams, Path(name))), "--for", str(seconds)]
        report, *one = (run_processes([*common, *way], Path(name), world, seconds) for way in ways)
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
        core = measure_simulation(loaded, robots, make_laser(beams, 270.25, 30.0), seconds, Options())
        figures.in_process = _in_process(one[0], report, core.rtf)
    return figures


def write_world(world: Path, beams: int, path: Path) -> None:
    """A world file at `path`: `world`, and the model `bench_robot` with a laser of so many beams."""
    path.write_text(_ROBOT.format(world=msgspec.json.encode(str(world.resolve())).decode(), beams=beams))


def write_line_team(world: Path, robots: int, beams: int, folder: Path) -> Path:
    """A team file in `folder`: a line of robots that drives round and round through the world.

    The head stands at the beginning of the circuit, the others behind it, each GAP from the one before.
    """
    team, changed = folder / "bench.toml", folder / "bench.world"
    waypoints = find_circuit(load_world(world), GAP * (robots - 1))
    way = Polyline([*waypoints, waypoints[0]])
    write_world(world, beams, changed)
    lines = ["[team]", f"world = {toml_text(str(changed))}", "world_robots = false"]
    head = {"behavior": "path", "waypoints": waypoints, "loop": True}
    for i in range(robots):
        pose = toml_text(way.at(-GAP * i % way.end))
        lines += ["[[robots]]", f"id = {i}", 'model = "bench_robot"', f"pose = {pose}"]
        lines += [f"{key} = {toml_text(value)}" for key, value in ({"follow": i - 1} if i else head).items()]
    team.write_text("\n".join(lines) + "\n")
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


def find_circuit(world: World, chain: float) -> list[tuple[float, float]]:
    """The waypoints of a closed way on which a chain of `chain` metres drives round and round without meeting itself.

    The last is joined to the first (x and y in `map`, metres). It depends on the world alone. Raises UsageError without
    one. One half is the shortest way between two places. The other one leads back while the first one is closed.
    """
    grid = map_grid(map_message(world, _CELL))
    outline = make_circle(CLEARANCE)
    options = CostmapOptions(inflation_radius=2.0 * CLEARANCE)
    costmap, planner = make_costmap(grid, outline, options), AStarPlanner()
    free = np.argwhere(costmap.costs == 0)
    found: list[Floats] = []
    for draw in range(_DRAWS if len(free) else 0):
        start, end = (
            Pose2(*grid.frame.centre_of(*free[int(uniform(1, draw, e) * len(free))].tolist()), 0.0) for e in (0, 1)
        )
        try:
            there = planner.plan(costmap, start, end).path[:, :2]
            closed = grid.cells.copy()
            for x, y in there[round(_NEAR / 2 / _CELL) : -round(_NEAR / 2 / _CELL)].tolist():
                row, column = grid.frame.cell_at(x, y)
                reach = round(APART / _CELL)
                closed[max(0, row - reach) : row + reach, max(0, column - reach) : column + reach] = OCCUPIED
            back = planner.plan(make_costmap(grid._replace(cells=closed), outline, options), end, start).path[:, :2]
        except NoPathError:
            continue
        way = _smooth(np.concatenate([there, back[1:-1]]))
        rows, columns = grid.frame.points_to_cells(way).astype(int).T[::-1]
        is_clear = costmap.costs[rows, columns].max() < INSCRIBED_INFLATED_OBSTACLE
        if is_clear and len(way) * _STEP >= chain + _SPARE and _is_apart(way):
            found.append(way)
            if len(found) == _CHOICES:
                break
    if not found:
        raise UsageError(f"world {world.name} has no way round of {chain + _SPARE:g} m for a line of so many robots")
    return [(round(float(x), 3), round(float(y), 3)) for x, y in max(found, key=len)[::10]]


def _smooth(loop: Floats) -> Floats:
    """A closed way (points, 2) as points _STEP apart, each the mean of those within half of WINDOW, twice."""
    loop = np.concatenate([loop, loop[:1]])
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(loop, axis=0).T))])
    even = np.arange(0.0, along[-1], _STEP)
    half = round(0.5 * WINDOW / _STEP)
    box = np.full(2 * half + 1, 1.0 / (2 * half + 1))
    axes = [np.interp(even, along, values) for values in loop.T]
    for _ in range(2):
        axes = [np.convolve(np.concatenate([a[-half:], a, a[:half]]), box, "valid") for a in axes]
    return np.stack(axes, axis=1)


def _is_apart(way: Floats) -> bool:
    """Whether no two parts of a closed way come near each other."""
    points = way[::5]
    along = np.abs(np.subtract.outer(*2 * [np.arange(len(points)) * 5 * _STEP]))
    length = len(way) * _STEP
    parts = np.minimum(along, length - along) > _NEAR
    return not (parts & (np.hypot(*(points[:, None] - points).T) < APART)).any()


def make_laser(beams: int, fov_deg: float, range_max: float) -> Ranger:
    """The laser of each robot: `range_max` in metres."""
    return Ranger("laser", 0.05, 0.0, 0.16, 0.0, math.radians(fov_deg), beams, 0.0, range_max)


def measure_simulation(world: World, robots: int, laser: Ranger, seconds: float, options: Options) -> SimulationFigures:
    """Run `robots` robots with this laser for `seconds` simulated seconds."""
    placed = place_robots(world, robots, _SEED)
    team = {i: msgspec.structs.replace(robot, rangers=(laser,)) for i, robot in placed.items()}
    engine = Engine(world, seed=_SEED, robots=team, options=options)
    ticks = max(1, round(seconds * 1e9 / world.interval))
    engine.step({})
    begin = process_time()
    commands: dict[int, Twist] = {}
    for tick in range(ticks):
        if tick % _TURN_TICKS == 0:
            turns = {i: 2.0 * uniform(_SEED, i, tick // _TURN_TICKS, 0) - 1.0 for i in team}
            commands = {i: Twist(Vector3(0.4), Vector3(0.0, 0.0, turn)) for i, turn in turns.items()}
        engine.step(commands)
    spent = max(process_time() - begin, 1e-9)
    simulated, rays = ticks * world.interval / 1e9, ticks * robots * laser.samples
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e6
    return SimulationFigures(
        robots, laser.samples, simulated, simulated / spent, rays / spent, 1e3 * spent / ticks, memory
    )


def place_robots(world: World, count: int, seed: int) -> dict[int, Robot]:
    """Erratics at poses within the world's bounds where they have room; they depend only on the seed.

    Raises UsageError if the world has no room for `count` robots, or does not define the model.
    """
    (left, bottom), (right, top) = find_bounds(world) or ([-REACH, -REACH], [REACH, REACH])
    found: dict[int, Robot] = {}
    for draw in range(1000 * count):
        shares = [uniform(seed, draw, 0, axis) for axis in (1, 2, 3)]
        pose = Pose2(left + (right - left) * shares[0], bottom + (top - bottom) * shares[1], math.tau * shares[2])
        robot = add_robot(world, "erratic", pose, f"bench_{len(found)}")
        if not find_hindrance(world, robot, found):
            found[len(found)] = robot
            if len(found) == count:
                return found
    raise UsageError(f"world {world.name} has no room for {count} robots: found only {len(found)} free poses")
