"""`zteam bench sim | team`: measure zteam here."""

import argparse
from collections.abc import Iterator
from functools import partial
from typing import Any

import msgspec

from zteam.cli.interrupts import raise_from_now
from zteam.cli.options import Parser, add_log_options, add_option, run_tool
from zteam.cli.tables import format_table
from zteam.config.numbers import MAX_SECONDS
from zteam.config.resources import find_world
from zteam.config.simulation_options import PHYSICS, Options
from zteam.errors import UsageError
from zteam.node.output import print_block, print_json


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


def _bench(args: argparse.Namespace) -> None:
    # The processes started here have to be ended.
    raise_from_now()
    figures = args.act(args)
    print_json(figures) if args.json else print_block(format_figures(figures))


def _measure_core(args: argparse.Namespace) -> msgspec.Struct:
    from zteam.cli.bench_team import make_laser, measure_simulation
    from zteam.simulator.world import load_world

    world, options = load_world(find_world(args.world)), Options(physics=args.physics)
    laser = make_laser(args.beams, args.fov_deg, args.range)
    return measure_simulation(world, args.robots, laser, args.seconds, options)


def _measure_team(args: argparse.Namespace) -> msgspec.Struct:
    from zteam.cli.bench_team import measure_team

    if args.realtime and args.in_process:
        raise UsageError("--in-process compares teams in lock-step: leave --realtime out")
    world_file, size = find_world(args.world), (args.robots, args.beams, args.seconds)
    return measure_team(world_file, *size, realtime=args.realtime, in_process=args.in_process)


def figure(value: float | None) -> str:
    """A measured number with three digits, which is what a repetition gives again; `-` for none."""
    if value is None:
        return "-"
    text = f"{value:#.3g}".rstrip(".")
    return f"{float(text):,.0f}" if "e+" in text else text


def format_figures(figures: msgspec.Struct) -> str:
    """A row for each figure that was measured; its name ends with its unit where it has one."""
    rows = list(_rows("", msgspec.to_builtins(figures)))
    return format_table(rows[0], rows[1:])


def _rows(name: str, value: Any) -> Iterator[tuple[str, str]]:
    if isinstance(value, dict):
        for key, part in value.items():
            yield from _rows(f"{name}.{key}" if name else key, part)
    elif value is not None:
        yield name, figure(value) if isinstance(value, float) else str(value)


main = partial(run_tool, build_parser, _bench)
