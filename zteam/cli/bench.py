"""`zteam bench sim | kernel | tf | team | codec`: figures of this machine."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import msgspec

from zteam.cli.interrupts import raise_from_now
from zteam.cli.options import Parser, number, run, whole
from zteam.numbers import MAX_SECONDS
from zteam.runtime.logs import LEVELS
from zteam.simulation_options import PHYSICS, Options


def build_parser() -> argparse.ArgumentParser:
    """The command line."""
    parser = Parser(prog="zteam bench", description=__doc__)
    verbs = parser.add_subparsers(dest="verb", required=True, metavar="sim|kernel|tf|team|codec")
    sim = verbs.add_parser("sim", help="the simulator's core alone, as fast as it goes")
    sim.add_argument("world", metavar="WORLD")
    sim.add_argument("--robots", type=whole(1, 10_000, "robots"), default=20)
    sim.add_argument("--beams", type=whole(2, 100_000, "beams"), default=1081)
    sim.add_argument("--fov-deg", type=number(1e-3, 360.0, "degrees"), default=270.0)
    sim.add_argument("--range", type=number(1e-3, 1e6, "metres"), default=30.0)
    sim.add_argument(
        "--seconds",
        type=number(1e-3, MAX_SECONDS, "simulated seconds"),
        default=20.0,
        help="simulated (default: %(default)s)",
    )
    sim.add_argument("--physics", choices=PHYSICS, help="default: what the world says, else dynamic")
    kernel = verbs.add_parser("kernel", help="rays against a bitmap alone, beside a plain scalar traversal")
    kernel.add_argument("world", nargs="?", default="office", metavar="WORLD")
    transforms = verbs.add_parser("tf", help="the transform buffer, beside tf2_py where it is installed")
    transforms.add_argument(
        "--tf2-path", type=Path, metavar="DIR", help="folder of tf2_py, if Python does not find it by itself"
    )
    team = verbs.add_parser(
        "team", help="a line of robots, all processes, in lock-step beside bare Zenoh, or in real time"
    )
    team.add_argument("world", nargs="?", default="office", metavar="WORLD")
    team.add_argument("--robots", type=whole(1, 10_000, "robots"), default=4)
    team.add_argument("--beams", type=whole(2, 100_000, "beams"), default=1081)
    team.add_argument(
        "--seconds",
        type=number(1e-3, MAX_SECONDS, "simulated seconds"),
        default=60.0,
        help="simulated (default: %(default)s)",
    )
    team.add_argument("--realtime", action="store_true", help="in real time: latency, lateness, CPU, memory")
    codec = verbs.add_parser("codec", help="encoding and decoding")
    for sub in (sim, kernel, transforms, team, codec):
        sub.add_argument("--json", action="store_true")
        sub.add_argument("--log-level", choices=LEVELS, default="warning")
        sub.add_argument("--log-format", choices=("text", "json"), default="text")
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point."""
    args = build_parser().parse_args(argv)
    return run("zteam bench", args, lambda: _bench(args))


def _bench(args: argparse.Namespace) -> int:
    # Processes are started, which have to be ended.
    raise_from_now()
    rows = _measure(args)
    if args.json:
        print(msgspec.json.encode(rows[0] if args.verb in ("sim", "team") else rows).decode())
        return 0
    for row in rows:
        print("  ".join(f"{name} {_shown(value)}" for name, value in msgspec.to_builtins(row).items()))
    return 0


def _shown(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _measure(args: argparse.Namespace) -> list[Any]:
    if args.verb == "codec":
        from zteam.bench.coding import measure_codec

        return list(measure_codec())
    if args.verb == "tf":
        from zteam.bench.transforms import measure_buffers, measure_listener

        return [*(measure_buffers(robots, args.tf2_path) for robots in (4, 100)), measure_listener(seconds=60)]
    if args.verb == "kernel":
        from zteam.bench.casting import measure_kernels
        from zteam.resources import find_world
        from zteam.world import load_world

        world = load_world(find_world(args.world))
        return [measure_kernels(world, 1081, 270.0), measure_kernels(world, 180, 180.0)]
    if args.verb == "team":
        from zteam.bench.running import measure_team
        from zteam.resources import find_world

        return [measure_team(find_world(args.world), args.robots, args.beams, args.seconds, realtime=args.realtime)]
    from zteam.bench.simulation import measure_simulation
    from zteam.resources import find_world
    from zteam.world import load_world

    world = load_world(find_world(args.world))
    options = Options(physics=args.physics)
    return [measure_simulation(world, args.robots, args.beams, args.fov_deg, args.range, args.seconds, options)]


if __name__ == "__main__":
    sys.exit(main())
