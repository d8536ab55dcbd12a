"""`zteam bench sim | team`: measure zteam here."""

import argparse
from functools import partial
from typing import TYPE_CHECKING, Any

import msgspec

from zteam.cli.arguments import add_option
from zteam.cli.interrupts import raise_from_now
from zteam.cli.options import Parser, add_log_options, run_tool
from zteam.cli.output import print_block, print_json
from zteam.cli.tables import format_table
from zteam.config.numbers import MAX_SECONDS, counted
from zteam.config.resources import find_world
from zteam.config.simulation_options import PHYSICS, Options
from zteam.errors import UsageError

if TYPE_CHECKING:
    from zteam.cli.bench_team import InProcessFigures, SimulationFigures, TeamFigures


def build_parser() -> Parser:
    parser = Parser(prog="zteam bench", description=__doc__)
    sim = parser.add_verb("sim", _measure_core, "measure the simulator's core alone, as fast as it runs")
    team = parser.add_verb("team", _measure_team, "measure a line of robots on a tour, in lock-step or in real time")
    sim.add_argument("world", metavar="WORLD", help="a world file, or the name of a shipped world")
    add_option(team, "world", nargs="?", default="office", metavar="WORLD", help="world to measure in")
    seconds = (1e-3, MAX_SECONDS, "simulated seconds")
    for sub, robots, duration in ((sim, 20, 20.0), (team, 4, 60.0)):
        add_option(sub, "--robots", typed=(1, 10_000, "robots"), default=robots, metavar="N", help="number of robots")
        add_option(sub, "--beams", typed=(2, 100_000, "beams"), default=1081, metavar="N", help="beams of a laser")
        add_option(sub, "--seconds", typed=seconds, default=duration, metavar="N", help="simulated seconds")
        sub.add_argument("--json", action="store_true", help="print JSON")
        add_log_options(sub, "warning")
    degrees, metres = (1e-3, 360.0, "degrees"), (1e-3, 1e6, "metres")
    add_option(sim, "--fov-deg", typed=degrees, default=270.0, metavar="N", help="field of view of the lasers, degrees")
    add_option(sim, "--range", typed=metres, default=30.0, metavar="N", help="maximum range of the lasers, metres")
    sim.add_argument("--physics", choices=PHYSICS, help="contacts (default: what the world says, else dynamic)")
    team.add_argument(
        "--realtime", action="store_true", help="run in real time; measure latency, lateness, CPU and memory"
    )
    text = "also run the same team in one process, and the simulator's core alone"
    team.add_argument("--in-process", action="store_true", help=text)
    return parser


def _bench(args: argparse.Namespace) -> int:
    # The processes started here have to be ended.
    raise_from_now()
    figures, text = args.act(args)
    print_json(figures) if args.json else print_block(text)
    return 0


def _measure_core(args: argparse.Namespace) -> tuple[Any, str]:
    from zteam.cli.bench_team import make_laser, measure_simulation
    from zteam.simulator.world import load_world

    world, options = load_world(find_world(args.world)), Options(physics=args.physics)
    laser = make_laser(args.beams, args.fov_deg, args.range)
    figures = measure_simulation(world, args.robots, laser, args.seconds, options)
    return figures, format_simulation(figures)


def _measure_team(args: argparse.Namespace) -> tuple[Any, str]:
    from zteam.cli.bench_team import measure_team

    if args.realtime and args.in_process:
        raise UsageError("--in-process compares teams in lock-step: leave --realtime out")
    world_file, size = find_world(args.world), (args.robots, args.beams, args.seconds)
    figures = measure_team(world_file, *size, realtime=args.realtime, in_process=args.in_process)
    return figures, format_team(figures)


def figure(value: float | None) -> str:
    """A measured number with three digits, which is what a repetition gives again; `-` for none."""
    if value is None:
        return "-"
    text = f"{value:#.3g}".rstrip(".")
    return f"{float(text):,.0f}" if "e+" in text else text


def format_simulation(row: "SimulationFigures") -> str:
    """The figures of the core as a table, with units."""
    pairs = [
        ("real-time factor", f"{figure(row.rtf)} (simulated seconds / CPU seconds of this process)"),
        ("rays", f"{figure(row.rays_per_s / 1e6)} million/s"),
        ("tick", f"{figure(row.step_ms)} ms"),
        ("memory", f"{figure(row.rss_mb)} MB (resident, at its peak)"),
    ]
    title = f"{counted(row.robots, 'robot')} and {row.beams} beams a laser, {row.seconds:g} simulated seconds"
    return "\n".join([title, format_table(pairs[0], pairs[1:])])


def format_team(row: "TeamFigures") -> str:
    """The figures of a team as tables, with units, then the parts of a tick."""
    pace = "lock-step, as fast as it runs" if row.lockstep else "real time"
    first, *others = _run_of(row)
    lines = [
        f"{row.world}: {counted(row.robots, 'robot')} and {row.beams} beams a laser, {pace}",
        format_table(first, others),
    ]
    if row.in_process is not None:
        lines += ["", *_in_process_of(row, row.in_process)]
    if row.timing_ms is not None:
        first, *others = ((name, f"{figure(cost)} ms") for name, cost in msgspec.to_builtins(row.timing_ms).items())
        lines += ["", "Parts of a tick in the simulator", format_table(first, others)]
    header, cells = ["process", "CPU, s"], [[name, figure(spent)] for name, spent in row.cpu_seconds.items()]
    if row.rounds:
        header += ["inputs, ms/tick", "acting, ms/tick"]
        for cell in cells:
            part = row.rounds.get(cell[0])
            cell += [figure(part.inputs if part else None), figure(part.act if part else None)]
    lines += ["", format_table(header, cells, numbers_from=1)]
    if row.rounds:
        lines.append("inputs: from the tick's arrival until all its inputs are there. acting: its work and the answer.")
    return "\n".join(lines)


def _in_process_of(row: "TeamFigures", one: "InProcessFigures") -> list[str]:
    """The three ways to run the team, one row each."""
    ways = [("processes", row.rtf), ("one process", one.rtf), ("simulator's core alone", one.core_rtf)]
    cells = [(way, figure(rtf), figure(rtf / row.rtf if rtf and row.rtf else None)) for way, rtf in ways]
    same = "the same in processes and in one" if one.same_trajectory else "NOT the same in one process"
    return [
        format_table(("the same team in", "real-time factor", "to processes"), cells, numbers_from=1),
        f"trajectory: {same}; memory of the one process: {figure(one.memory_mb)} MB",
        f"a robot's step with its answer: {figure(one.robot_us)} µs",
    ]


def _run_of(row: "TeamFigures") -> list[tuple[str, str]]:
    pairs = [
        ("real-time factor", f"{figure(row.rtf)} (simulated seconds / host seconds, from GO on)"),
        ("ticks", f"{figure(row.ticks_per_s)} /s"),
        ("GO", f"{figure(row.go_after_seconds)} s after the start"),
        ("scan to command", f"{figure(row.latency_p50_ms)} ms (median), {figure(row.latency_p99_ms)} ms (99 %)"),
    ]
    if row.lateness_p99_ms is not None:
        pairs.append(("ticks late by", f"{figure(row.lateness_p99_ms)} ms (99 %)"))
    late, again = counted(row.late_steps, "late step"), counted(row.resends, "tick")
    return [
        *pairs,
        ("driven", f"{figure(row.least_driven_m)} m by the robot that drove least"),
        ("lost", f"{late}, {again} sent again, {counted(row.dropped, 'message')} refused"),
        ("memory", f"{figure(row.pss_mb)} MB (PSS of all processes, each at its peak)"),
        ("trajectory", row.trajectory_sha256),
    ]


main = partial(run_tool, build_parser, _bench)
