"""`zteam bench sim | kernel | tf | team | codec`: measure zteam on this machine."""

import argparse
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import msgspec

from zteam.cli import bench_tables
from zteam.cli.arguments import number, whole
from zteam.cli.interrupts import raise_from_now
from zteam.cli.options import Parser, add_log_options, run
from zteam.numbers import MAX_SECONDS
from zteam.resources import find_world
from zteam.simulation_options import PHYSICS, Options

FORMATS: dict[str, Callable[[Sequence[Any]], str]] = {
    "sim": bench_tables.format_simulation,
    "kernel": bench_tables.format_kernels,
    "tf": bench_tables.format_transforms,
    "team": bench_tables.format_team,
    "codec": bench_tables.format_codec,
}
"""Verb -> what makes a text of its figures."""


def build_parser() -> argparse.ArgumentParser:
    """The command line."""
    parser = Parser(prog="zteam bench", description=__doc__)
    verbs = parser.add_subparsers(dest="verb", required=True, metavar="sim|kernel|tf|team|codec")
    sim = verbs.add_parser("sim", help="measure the simulator's core alone, as fast as it runs")
    kernel = verbs.add_parser("kernel", help="measure rays against a bitmap, beside a plain scalar grid traversal")
    transforms = verbs.add_parser("tf", help="measure the transform buffer, beside tf2_py if that is installed")
    team = verbs.add_parser("team", help="measure a line of robots in processes, in lock-step or in real time")
    codec = verbs.add_parser("codec", help="measure encoding and decoding")
    sim.add_argument("world", metavar="WORLD", help="a world file, or the name of a shipped world")
    for sub in (kernel, team):
        sub.add_argument(
            "world", nargs="?", default="office", metavar="WORLD", help="world to measure in (default: %(default)s)"
        )
    _add_team_size(sim, robots=20, seconds=20.0)
    _add_team_size(team, robots=4, seconds=60.0)
    _add_number(sim, "--fov-deg", number(1e-3, 360.0, "degrees"), 270.0, "field of view of the lasers, degrees")
    _add_number(sim, "--range", number(1e-3, 1e6, "metres"), 30.0, "maximum range of the lasers, metres")
    sim.add_argument("--physics", choices=PHYSICS, help="contacts (default: what the world says, else dynamic)")
    transforms.add_argument("--tf2-path", type=Path, metavar="DIR", help="folder of tf2_py, if Python does not find it")
    team.add_argument(
        "--realtime", action="store_true", help="run in real time; measure latency, lateness, CPU and memory"
    )
    for sub in (sim, kernel, transforms, team, codec):
        sub.add_argument("--json", action="store_true", help="print JSON")
        add_log_options(sub, "warning")
    return parser


def _add_team_size(parser: argparse.ArgumentParser, robots: int, seconds: float) -> None:
    _add_number(parser, "--robots", whole(1, 10_000, "robots"), robots, "number of robots")
    _add_number(parser, "--beams", whole(2, 100_000, "beams"), 1081, "beams of a laser")
    _add_number(parser, "--seconds", number(1e-3, MAX_SECONDS, "simulated seconds"), seconds, "simulated seconds")


def _add_number(
    parser: argparse.ArgumentParser, option: str, kind: Callable[[str], float], default: float, text: str
) -> None:
    parser.add_argument(option, type=kind, default=default, metavar="N", help=f"{text} (default: %(default)g)")


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point."""
    args = build_parser().parse_args(argv)
    return run("zteam bench", args, lambda: _bench(args))


def _bench(args: argparse.Namespace) -> int:
    # The processes started here have to be ended.
    raise_from_now()
    rows = _measure(args)
    if args.json:
        print(msgspec.json.encode(rows[0] if args.verb in ("sim", "team") else rows).decode())
        return 0
    print(FORMATS[args.verb](rows))
    return 0


def _measure(args: argparse.Namespace) -> list[Any]:
    if args.verb == "codec":
        from zteam.bench.coding import measure_codec

        return list(measure_codec())
    if args.verb == "tf":
        from zteam.bench.transforms import measure_buffers, measure_listener

        return [*(measure_buffers(robots, args.tf2_path) for robots in (4, 100)), measure_listener(seconds=60)]
    if args.verb == "kernel":
        from zteam.bench.casting import measure_kernels
        from zteam.world import load_world

        world = load_world(find_world(args.world))
        return [measure_kernels(world, 1081, 270.0), measure_kernels(world, 180, 180.0)]
    if args.verb == "team":
        from zteam.bench.running import measure_team

        return [measure_team(find_world(args.world), args.robots, args.beams, args.seconds, realtime=args.realtime)]
    from zteam.bench.simulation import measure_simulation
    from zteam.world import load_world

    world = load_world(find_world(args.world))
    options = Options(physics=args.physics)
    return [measure_simulation(world, args.robots, args.beams, args.fov_deg, args.range, args.seconds, options)]


if __name__ == "__main__":
    sys.exit(main())
