"""`zteam bench sim | team`: measure zteam here: a team of real processes, and the simulator's core alone.

The team is a line of robots on a circle, in lock-step as fast as it runs or in real time. The core runs as fast as it
can, with wandering robots that start at seeded free poses.
"""

import argparse
import math
import os
import resource
import subprocess
import tempfile
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec

from zteam import names
from zteam.cli.interrupts import raise_from_now
from zteam.cli.options import Parser, add_json, add_log_options, add_option, run_tool
from zteam.cli.tables import format_table
from zteam.clock import process_time
from zteam.config.numbers import MAX_SECONDS
from zteam.config.resources import find_world
from zteam.config.simulation_options import PHYSICS, Options
from zteam.config.toml_values import toml_text
from zteam.counter_random import uniform
from zteam.errors import UsageError, ZteamError
from zteam.geometry import FAR, Pose2
from zteam.messages import Twist, Vector3
from zteam.node.output import print_block, print_json
from zteam.simulator.world import Ranger, Robot, World, add_robot, load_world
from zteam.simulator.world.placing import find_bounds, find_hindrance

if TYPE_CHECKING:
    from zteam.team.run.report import RunReport

GAP = 0.8
"""Metres along the way between neighbours at the start."""
_LEAST_RADIUS, _CLEARANCE, _SPARE = 1.2, 0.3, 2.0
"""Metres: of a circuit, how much room is left on both sides, and from the head of the chain to its last robot, which
drives ahead of it, at least."""
_SEED = 1
_TURN_TICKS = 20
"""Ticks after which a wandering robot chooses a new turn rate."""
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
Figures = dict[str, Any]
"""Measured numbers by name, which ends with the unit where there is one; a part has its own figures."""


def build_parser() -> Parser:
    parser = Parser(prog="zteam bench", description=__doc__)
    text = "measure a line of robots on a circle, in lock-step or in real time"
    team = parser.add_verb("team", _measure_team, text)
    sim = parser.add_verb("sim", _measure_core, "measure the simulator's core alone, as fast as it runs")
    sim.add_argument("world", metavar="WORLD", help="a world file, or the name of a shipped world")
    add_option(team, "world", nargs="?", default="office", metavar="WORLD", help="world to measure in")
    seconds = (1e-3, MAX_SECONDS, "simulated seconds")
    for sub, robots, duration in ((sim, 20, 20.0), (team, 4, 60.0)):
        add_option(sub, "--robots", typed=(1, 10_000, "robots"), default=robots, metavar="N", help="number of robots")
        least, text = (0, "beams of a laser (0: no laser)") if sub is sim else (2, "beams of a laser")
        add_option(sub, "--beams", typed=(least, 100_000, "beams"), default=1081, metavar="N", help=text)
        add_option(sub, "--seconds", typed=seconds, default=duration, metavar="N", help="simulated seconds")
        add_json(sub)
        add_log_options(sub, "warning")
    degrees, metres = (1e-3, 360.0, "degrees"), (1e-3, 1e6, "metres")
    add_option(sim, "--fov-deg", typed=degrees, default=270.0, metavar="N", help="field of view of the lasers, degrees")
    add_option(sim, "--range", typed=metres, default=30.0, metavar="N", help="maximum range of the lasers, metres")
    sim.add_argument("--physics", choices=PHYSICS, help="contacts (default: what the world says, else dynamic)")
    share, text = (0.0, 1.0, "share of the robots"), "share of the robots that drive; the others stand"
    add_option(sim, "--driving", typed=share, default=1.0, metavar="SHARE", help=text)
    text = "run in real time; measure latency, lateness, CPU and memory"
    how = team.add_mutually_exclusive_group()
    how.add_argument("--realtime", action="store_true", help=text)
    text = "also run the same team in one process, and the simulator's core alone"
    how.add_argument("--in-process", action="store_true", help=text)
    return parser


def _bench(args: argparse.Namespace) -> None:
    # The processes started here have to be ended.
    raise_from_now()
    figures = args.act(args)
    print_json(figures) if args.json else print_block(format_figures(figures))


def _measure_core(args: argparse.Namespace) -> Figures:
    laser = make_laser(args.beams, args.fov_deg, args.range) if args.beams else None
    world, options = load_world(find_world(args.world)), Options(physics=args.physics)
    return measure_simulation(world, args.robots, laser, args.seconds, options, args.driving)


def _measure_team(args: argparse.Namespace) -> Figures:
    world, size = find_world(args.world), (args.robots, args.beams, args.seconds)
    return measure_team(world, *size, realtime=args.realtime, in_process=args.in_process)


def figure(value: float | None) -> str:
    """A measured number with three digits, which is what a repetition gives again; `-` for none."""
    if value is None:
        return "-"
    text = f"{value:#.3g}".rstrip(".")
    return f"{float(text):,.0f}" if "e+" in text else text


def format_figures(figures: Figures) -> str:
    """A row for each figure that was measured."""
    rows = list(_rows("", msgspec.to_builtins(figures)))
    return format_table(rows[0], rows[1:])


def _rows(name: str, value: Any) -> Iterator[tuple[str, str]]:
    if isinstance(value, dict):
        for key, part in value.items():
            yield from _rows(f"{name}.{key}" if name else key, part)
    elif value is not None:
        yield name, figure(value) if isinstance(value, float) else str(value)


def measure_team(
    world: Path, robots: int, beams: int, seconds: float, *, realtime: bool = False, in_process: bool = False
) -> Figures:
    """Run a line of `robots` robots with lasers of `beams` beams for `seconds` simulated seconds after GO.

    With `in_process` the same team runs a second time, in one process, and the simulator's core alone runs after it.
    Raises UsageError for a world without room for the circuit, ZteamError with the last lines of a run that fails.
    """
    loaded = load_world(world)
    ways = [[] if realtime else ["--lockstep"], *([["--lockstep", "--in-process"]] if in_process else [])]
    with tempfile.TemporaryDirectory() as name:
        common = [str(write_line_team(world, robots, beams, Path(name))), "--for", str(seconds)]
        report, *one = (run_processes([*common, *way], Path(name), world, seconds) for way in ways)
    rtf = report.real_time_factor
    figures = {
        "world": loaded.name,
        "robots": robots,
        "beams": beams,
        "lockstep": report.lockstep,
        # Simulated seconds per host second, from GO on.
        "rtf": rtf,
        "ticks_per_s": None if rtf is None else rtf * 1e9 / loaded.interval,
        # Parts of the simulator's time per tick, and of the participants' (lock-step).
        "timing_ms": report.timing_ms,
        "rounds": report.rounds,
        "go_after_seconds": report.go_after_seconds,
        # From a scan sent to its command received, measured in the simulator.
        "latency_p50_ms": report.latency_ms.p50,
        "latency_p99_ms": report.latency_ms.p99,
        # Delay of ticks after the time they were due (real time).
        "lateness_p99_ms": report.lateness_p99_ms,
        "late_steps": sum(robot.late_steps for robot in report.robots),
        "resends": report.resends,
        "trajectory_sha256": report.trajectory_sha256,
        "pss_mb": _memory(report),
        "cpu_seconds": {process.name: process.cpu_seconds for process in report.processes},
        "dropped": sum(report.dropped.values()),
        "least_driven_m": min(robot.distance_m for robot in report.robots),
    }
    for alone in one:
        core = measure_simulation(loaded, robots, make_laser(beams, 270.25, 30.0), seconds, Options())
        acts = [timing.act for name, timing in alone.rounds.items() if names.robot_id_of(name) is not None]
        figures["in_process"] = {
            "rtf": alone.real_time_factor,
            "core_rtf": core["rtf"],
            # Of a robot's step and its answer, on average over robots and ticks.
            "robot_us": 1e3 * sum(acts) / max(1, len(acts)),
            "same_trajectory": alone.trajectory_sha256 == report.trajectory_sha256,
            "memory_mb": _memory(alone),
        }
    return figures


def _memory(report: "RunReport") -> float:
    """The sum of PSS over all processes, each at its peak."""
    return round(sum(process.pss_mb for process in report.processes), 1)


def write_world(world: Path, beams: int, path: Path) -> None:
    """A world file at `path`: `world`, and the model `bench_robot` with a laser of so many beams."""
    path.write_text(_ROBOT.format(world=msgspec.json.encode(str(world.resolve())).decode(), beams=beams))


def write_line_team(world: Path, robots: int, beams: int, folder: Path) -> Path:
    """A team file in `folder`: a line of robots that drives round and round on a circle, GAP behind each other."""
    team, changed = folder / "bench.toml", folder / "bench.world"
    write_world(world, beams, changed)
    centre, radius = find_circuit(load_world(world), robots)
    turns = [math.tau * i / 100 for i in range(100)]
    waypoints = [on_circle(centre, radius, turn)[:2] for turn in turns]
    lines = ["[team]", f"world = {toml_text(str(changed))}", "world_robots = false"]
    head = {"behavior": "path", "waypoints": waypoints, "loop": True}
    for i in range(robots):
        pose = toml_text(on_circle(centre, radius, -GAP * i / radius))
        lines += ["[[robots]]", f"id = {i}", 'model = "bench_robot"', f"pose = {pose}"]
        lines += [f"{key} = {toml_text(value)}" for key, value in ({"follow": i - 1} if i else head).items()]
    team.write_text("\n".join(lines) + "\n")
    return team


def run_processes(arguments: list[str], folder: Path, world: Path, seconds: float) -> "RunReport":
    """Run `zteam up` with these arguments; files that `world` includes are found beside it. Raises ZteamError."""
    from zteam.team.launch.process import zteam_command
    from zteam.team.run.report import RunReport

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


def find_circuit(world: World, robots: int) -> tuple[Pose2, float]:
    """The centre (in `map`) and the radius of a circle on which a chain drives round and round in an empty world.

    It depends on the world and the number of robots alone. Raises UsageError without one.
    """
    radius = max(_LEAST_RADIUS, (GAP * (robots - 1) + _SPARE) / math.tau)
    turns = [i * 0.2 / radius for i in range(math.ceil(math.tau * radius / 0.2))]
    robot = add_robot(world, "erratic", Pose2(0.0, 0.0, 0.0), "bench")
    for draw in range(2000):
        centre = _draw_pose(world, _SEED, draw)
        places = (on_circle(centre, radius + side, t) for t in turns for side in (0.0, _CLEARANCE, -_CLEARANCE))
        if not any(find_hindrance(world, msgspec.structs.replace(robot, pose=place), {}) for place in places):
            return centre, radius
    raise UsageError(f"world {world.name} has no room for a circle of {radius:.1f} m for a line of so many robots")


def on_circle(centre: Pose2, radius: float, turn: float) -> Pose2:
    """The pose in `map`, along the circle, at an angle from its `centre`."""
    return Pose2(centre.x + radius * math.cos(turn), centre.y + radius * math.sin(turn), turn + math.pi / 2)


def _draw_pose(world: World, seed: int, draw: int) -> Pose2:
    """A pose within the world's bounds, which depends only on the seed and the number of the draw."""
    (left, bottom), (right, top) = find_bounds(world) or ([-FAR, -FAR], [FAR, FAR])
    x, y, yaw = (uniform(seed, draw, 0, axis) for axis in (1, 2, 3))
    return Pose2(float(left + (right - left) * x), float(bottom + (top - bottom) * y), math.tau * yaw)


def make_laser(beams: int, fov_deg: float, range_max: float) -> Ranger:
    """The laser of each robot: `range_max` in metres."""
    return Ranger("laser", 0.05, 0.0, 0.16, 0.0, math.radians(fov_deg), beams, 0.0, range_max)


def measure_simulation(
    world: World, robots: int, laser: Ranger | None, seconds: float, options: Options, driving: float = 1.0
) -> Figures:
    """Run `robots` robots with this laser for `seconds` simulated seconds; a share of `driving` of them drives.

    Figures are per CPU second of this process, which other load affects little.
    """
    from zteam.simulator.core import Engine

    placed = place_robots(world, robots, _SEED)
    rangers, beams = ((laser,), laser.samples) if laser else ((), 0)
    team = {i: msgspec.structs.replace(robot, rangers=rangers) for i, robot in placed.items()}
    # Robots stand between those that drive, not beside them.
    drivers = [i for i in team if int((i + 1) * driving) > int(i * driving)]
    engine = Engine(world, seed=_SEED, robots=team, options=options)
    ticks = max(1, round(seconds * 1e9 / world.interval))
    engine.step({})
    begin = process_time()
    commands: dict[int, Twist] = {}
    for tick in range(ticks):
        if tick % _TURN_TICKS == 0:
            turns = {i: 2.0 * uniform(_SEED, i, tick // _TURN_TICKS, 0) - 1.0 for i in drivers}
            commands = {i: Twist(Vector3(0.4), Vector3(0.0, 0.0, turn)) for i, turn in turns.items()}
        engine.step(commands)
    spent = max(process_time() - begin, 1e-9)
    simulated = ticks * world.interval / 1e9
    return {
        "robots": robots,
        "driving": len(drivers),
        "beams": beams,
        "physics": options.physics or world.physics,
        "tick_ms": world.interval / 1e6,
        "seconds": simulated,
        # Simulated seconds per CPU second.
        "rtf": simulated / spent,
        "rays_per_s": ticks * robots * beams / spent,
        "step_ms": 1e3 * spent / ticks,
        # Peak resident memory of the process, 10⁶ bytes.
        "rss_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e6,
    }


def place_robots(world: World, count: int, seed: int) -> dict[int, Robot]:
    """Erratics at poses within the world's bounds where they have room; they depend only on the seed.

    Raises UsageError if the world has no room for `count` robots, or does not define the model.
    """
    found: dict[int, Robot] = {}
    for draw in range(1000 * count):
        robot = add_robot(world, "erratic", _draw_pose(world, seed, draw), f"bench_{len(found)}")
        if not find_hindrance(world, robot, found):
            found[len(found)] = robot
            if len(found) == count:
                return found
    raise UsageError(f"world {world.name} has no room for {count} robots: found only {len(found)} free poses")


main = partial(run_tool, build_parser, _bench)
