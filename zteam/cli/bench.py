"""`zteam bench sim | kernel | tf | team | view | robots | steps | nav | codec | study`: measure zteam here."""

import argparse
import sys
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import msgspec

from zteam.cli import (
    bench_nav_tables,
    bench_robots_tables,
    bench_steps_tables,
    bench_study,
    bench_tables,
    bench_view_tables,
)
from zteam.cli.arguments import number, whole
from zteam.cli.interrupts import leave, raise_from_now
from zteam.cli.live_line import LiveLine, has_live_line
from zteam.cli.options import Parser, add_log_options, run
from zteam.errors import UsageError
from zteam.numbers import MAX_SECONDS
from zteam.resources import find_world
from zteam.simulation_options import PHYSICS, Options

FORMATS: dict[str, Callable[[Sequence[Any]], str]] = {
    "sim": bench_tables.format_simulation,
    "kernel": bench_tables.format_kernels,
    "tf": bench_tables.format_transforms,
    "team": bench_tables.format_team,
    "view": bench_view_tables.format_view,
    "robots": bench_robots_tables.format_robots,
    "steps": bench_steps_tables.format_steps,
    "nav": bench_nav_tables.format_navigation,
    "codec": bench_tables.format_codec,
    "study": bench_study.format_study,
}
"""Verb -> what makes a text of its figures."""
CHAINS = ("lectures", "direct", "trail", "trail16", "disturbed")
"""Rows of `zteam bench robots` (zteam.bench.chains.figures)."""
VIEW_PARTS = ("load", "slow", "many", "cost", "browser", "start")
"""Of `zteam bench view` (zteam.bench.view.figures)."""
NAV_ROWS = ("plan", "costmap", "amcl", "tours", "global", "team-fake", "team-amcl", "crowd", "robot", "fleet")
"""Rows of `zteam bench nav` (zteam.bench.navigation.figures)."""
FORMATIONS = "formations"
"""Its table of all shapes (zteam.bench.formations)."""


def build_parser() -> argparse.ArgumentParser:
    """The command line."""
    parser = Parser(prog="zteam bench", description=__doc__)
    verbs = parser.add_subparsers(
        dest="verb", required=True, metavar="sim|kernel|tf|team|view|robots|steps|nav|codec|study"
    )
    sim = verbs.add_parser("sim", help="measure the simulator's core alone, as fast as it runs")
    kernel = verbs.add_parser("kernel", help="measure rays against a bitmap, and against robots")
    transforms = verbs.add_parser("tf", help="measure the transform buffer, beside tf2_py if that is installed")
    team = verbs.add_parser("team", help="measure a line of robots on a tour, in lock-step or in real time")
    view = verbs.add_parser("view", help="measure a view: age of frames, memory, its cost in lock-step, drawing")
    robots = verbs.add_parser("robots", help="measure how well robots follow each other, and hold formations")
    steps = verbs.add_parser("steps", help="measure a robot's step: velocity mux, behaviour and safety layer")
    nav = verbs.add_parser("nav", help="measure planning, costmaps, localisation, and robots that navigate")
    verbs.add_parser("codec", help="measure encoding and decoding")
    sim.add_argument("world", metavar="WORLD", help="a world file, or the name of a shipped world")
    for sub in (kernel, team, view, nav):
        sub.add_argument(
            "world", nargs="?", default="office", metavar="WORLD", help="world to measure in (default: %(default)s)"
        )
    _add_team_size(sim, robots=20, seconds=20.0)
    _add_team_size(team, robots=4, seconds=60.0)
    _add_number(sim, "--fov-deg", number(1e-3, 360.0, "degrees"), 270.0, "field of view of the lasers, degrees")
    _add_number(sim, "--range", number(1e-3, 1e6, "metres"), 30.0, "maximum range of the lasers, metres")
    sim.add_argument("--physics", choices=PHYSICS, help="contacts (default: what the world says, else dynamic)")
    transforms.add_argument("--tf2-path", type=Path, metavar="DIR", help="folder of tf2_py, if Python does not find it")
    _add_ways(team)
    _add_view(view)
    _add_robots(robots)
    _add_navigation(nav)
    bench_study.add_study(verbs.add_parser("study", help="run lines from many seeds: how well they hold and drive"))
    _add_number(steps, "--seconds", number(1.0, 600.0, "simulated seconds"), 20.0, "simulated seconds of each scene")
    for sub in verbs.choices.values():
        sub.add_argument("--json", action="store_true", help="print JSON")
        add_log_options(sub, "warning")
    return parser


def _add_ways(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--realtime", action="store_true", help="run in real time; measure latency, lateness, CPU and memory"
    )
    parser.add_argument(
        "--in-process",
        action="store_true",
        help="also run the same team in one process, and the simulator's core alone",
    )


def _add_view(parser: argparse.ArgumentParser) -> None:
    _add_number(parser, "--seconds", number(2.0, 600.0, "seconds"), 10.0, "host seconds of each measurement")
    _add_number(parser, "--pairs", whole(1, 100, "pairs"), 10, "pairs of runs in lock-step")
    parser.add_argument(
        "--parts",
        nargs="+",
        choices=VIEW_PARTS,
        default=VIEW_PARTS,
        metavar="PART",
        help=f"only these ({', '.join(VIEW_PARTS)})",
    )


def _add_robots(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "worlds", nargs="*", default=["office"], metavar="WORLD", help="worlds to drive in (default: office)"
    )
    rows = (*CHAINS, FORMATIONS)
    parser.add_argument(
        "--rows", nargs="+", choices=rows, default=rows, metavar="ROW", help=f"only these ({', '.join(rows)})"
    )
    parser.add_argument(
        "--tours",
        type=whole(1, 30, "tours"),
        metavar="N",
        help="drive only the first N tours; formations from the first N starts",
    )
    parser.add_argument(
        "--in-process", action="store_true", help="run each team in one process, several at once: the same figures"
    )


def _add_navigation(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--rows",
        nargs="+",
        choices=NAV_ROWS,
        default=NAV_ROWS,
        metavar="ROW",
        help=f"only these ({', '.join(NAV_ROWS)})",
    )
    _add_number(parser, "--tours", whole(1, 1000, "tours"), 30, "number of tours; two thirds as many random starts")
    parser.add_argument(
        "--scenarios", type=Path, metavar="DIR", help="folder of MovingAI's .map and .scen files: check all lengths"
    )


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
        print(msgspec.json.encode(rows[0] if args.verb in ("sim", "team", "view") else rows).decode())
    else:
        print(FORMATS[args.verb](rows))
    return bench_study.exit_code(rows) if args.verb == "study" else 0


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
        return measure_kernels(world)
    if args.verb == "study":
        return list(bench_study.measure_study(args))
    if args.verb == "robots":
        return _measure_robots(args)
    if args.verb == "view":
        return [_measure_view(args)]
    if args.verb == "nav":
        return _measure_navigation(args)
    if args.verb == "steps":
        from zteam.bench.steps.figures import measure_steps

        return list(measure_steps(args.seconds))
    if args.verb == "team":
        from zteam.bench.running import measure_team

        if args.realtime and args.in_process:
            raise UsageError("--in-process compares teams in lock-step: leave --realtime out")
        world_file, size = find_world(args.world), (args.robots, args.beams, args.seconds)
        return [measure_team(world_file, *size, realtime=args.realtime, in_process=args.in_process)]
    from zteam.bench.simulation import measure_simulation
    from zteam.world import load_world

    world = load_world(find_world(args.world))
    options = Options(physics=args.physics)
    return [measure_simulation(world, args.robots, args.beams, args.fov_deg, args.range, args.seconds, options)]


def _measure_view(args: argparse.Namespace) -> Any:
    from zteam.bench.view.figures import measure_view

    with LiveLine(sys.stderr) if has_live_line(sys.stderr) else nullcontext() as live:

        def show(text: str) -> None:
            if live is not None:
                live.show(lambda _columns: text)

        return measure_view(find_world(args.world), args.seconds, args.pairs, tuple(args.parts), show)


def _measure_robots(args: argparse.Namespace) -> list[Any]:
    from zteam.bench.chains.figures import measure_chains
    from zteam.bench.formations import measure_formations

    chains = [row for row in args.rows if row != FORMATIONS]
    worlds = [find_world(name) for name in args.worlds] if chains else []
    with LiveLine(sys.stderr) if has_live_line(sys.stderr) else nullcontext() as live:

        def show(row: str, done: int, total: int) -> None:
            if live is not None:
                live.show(lambda _columns: f"{row}: run {done} of {total}")

        found: list[Any] = []
        for world in worlds:
            found += measure_chains(world, chains, args.tours, in_process=args.in_process, progress=show)
        if FORMATIONS in args.rows:
            found += measure_formations(args.tours, in_process=args.in_process, progress=show)
    return found


def _measure_navigation(args: argparse.Namespace) -> list[Any]:
    from zteam.bench.navigation.figures import measure_navigation

    world = find_world(args.world)
    with LiveLine(sys.stderr) if has_live_line(sys.stderr) else nullcontext() as live:

        def show(row: str, done: int, total: int) -> None:
            if live is not None:
                live.show(lambda _columns: f"{row}: {done} of {total}")

        return list(measure_navigation(world, args.rows, args.tours, args.scenarios, show))


if __name__ == "__main__":
    leave(main())
