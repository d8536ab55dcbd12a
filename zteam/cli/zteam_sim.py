"""`zteam-sim WORLD`: run the simulator. It reads Stage's world files; a robot's id is its place in the file."""

import argparse
from collections.abc import Callable
from functools import partial
from pathlib import Path

import msgspec

from zteam import names
from zteam.cli.arguments import LOCKSTEP_TIMEOUTS, MIN_RUN, UNTIL_TICKS, add_seed_option, number, parse_speed, whole
from zteam.cli.options import Parser, add_bus_options, run_process
from zteam.config.numbers import MAX_SECONDS, parse_number
from zteam.config.resources import find_world
from zteam.config.simulation_options import PHYSICS, Options
from zteam.errors import UsageError
from zteam.geometry import Pose2
from zteam.node.process_options import LockStepOptions, SimOptions
from zteam.simulator.client import MAX_PLACE


def build_parser() -> Parser:
    """The command line."""
    parser = Parser(prog="zteam-sim", description=__doc__)
    parser.add_argument("world", metavar="WORLD", help="a .world file, or the name of a shipped world such as office")
    add_seed_option(parser)
    parser.add_argument(
        "--map-resolution",
        type=number(1e-4, 1e4, "metres a cell"),
        default=0.05,
        metavar="M",
        help="cell size of the published map, metres (default: %(default)s)",
    )
    parser.add_argument("--no-map", action="store_true", help="publish no map: zteam-map serves another one")
    group = parser.add_argument_group("robots")
    group.add_argument(
        "--add",
        action="append",
        default=[],
        metavar="ID:MODEL:X:Y:YAW",
        help="add a robot to the world's own, e.g. 7:erratic:2.0:3.5:1.57 (repeatable)",
    )
    group.add_argument("--only-added", action="store_true", help="leave out the world's own robots")
    group.add_argument(
        "--gap",
        action="append",
        default=[],
        metavar="FOLLOWER:LEADER",
        help="measure the gap between two robots, e.g. 1:0 (repeatable)",
    )
    _add_time_options(parser)
    _add_simulation_options(parser)
    add_bus_options(parser)
    return parser


def _add_time_options(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("time (docs/time.md)")
    group.add_argument(
        "--for",
        dest="run_for",
        type=number(MIN_RUN, MAX_SECONDS, "simulated seconds"),
        metavar="SECONDS",
        help="pause this many simulated seconds after GO, and keep answering queries",
    )
    group.add_argument(
        "--until",
        type=whole(*UNTIL_TICKS, "a tick"),
        metavar="TICK",
        help="pause before this tick, and keep answering queries",
    )
    group.add_argument(
        "--speed", metavar="X", help="simulated seconds per host second, or max (default: 1; max in lock-step)"
    )
    group.add_argument("--paused", action="store_true", help="pause at the first tick ('zteam sim resume' continues)")
    group.add_argument("--lockstep", action="store_true", help="begin a tick when every participant has answered")
    group.add_argument(
        "--lockstep-timeout",
        type=number(*LOCKSTEP_TIMEOUTS, "host seconds"),
        default=10.0,
        metavar="SECONDS",
        help="stop waiting for a live participant that does not answer for so long (default: %(default)g)",
    )
    group.add_argument(
        "--expect",
        nargs="+",
        default=[],
        metavar="NAME",
        help="hold the first tick until these participate, e.g. tf robot_0 planner; needs --lockstep",
    )
    group.add_argument(
        "--no-gate", action="store_true", help="do not wait for the monitor's GO in lock-step; needs --lockstep"
    )


def _add_simulation_options(parser: argparse.ArgumentParser) -> None:
    """One flag for every field of `zteam.config.simulation_options.Options`."""
    group = parser.add_argument_group("contacts and sensors (docs/simulator.md)")
    group.add_argument(
        "--physics", choices=PHYSICS, help="how contacts are simulated (default: what the world says, else dynamic)"
    )
    group.add_argument(
        "--no-hit", choices=("range_max", "inf"), help="range of a beam that hits nothing (default: range_max)"
    )
    group.add_argument(
        "--below-min",
        choices=("measured", "-inf", "zero"),
        help="range of a beam that hits something nearer than range_min (default: measured)",
    )
    group.add_argument("--gaussian-noise", type=float, metavar="M", help="noise of all lasers: standard deviation, m")
    group.add_argument(
        "--proportional-noise", type=float, metavar="SHARE", help="noise of all lasers: standard deviation / range"
    )
    group.add_argument(
        "--odom-alphas", metavar="A1,A2,A3,A4", help="noise of all odometry (Thrun), e.g. 0.05,0.01,0.02,0.01"
    )
    group.add_argument(
        "--dazzle",
        choices=("off", "drop", "max", "short", "scan"),
        help="interference of lasers that see each other (default: off)",
    )
    group.add_argument(
        "--dazzle-angle", type=float, metavar="RAD", help="angle on either side of the other laser (default: 0.035)"
    )
    group.add_argument("--dazzle-probability", type=float, metavar="P", help="share of dazzled scans (default: 1)")


def simulation_options(args: argparse.Namespace) -> Options:
    """The simulation options of a parsed command line. Raises UsageError."""
    given = {name: getattr(args, name) for name in Options.__struct_fields__ if getattr(args, name) is not None}
    try:
        if "odom_alphas" in given:
            given["odom_alphas"] = tuple(map(float, given["odom_alphas"].split(",")))
            if len(given["odom_alphas"]) != 4:
                raise ValueError("--odom-alphas takes four numbers, such as 0.05,0.01,0.02,0.01")
        return Options(**given)
    except ValueError as error:
        raise UsageError(str(error)) from None


def lockstep_options(args: argparse.Namespace) -> LockStepOptions | None:
    """The lock-step options of a parsed command line; None without `--lockstep`. Raises UsageError."""
    if not args.lockstep:
        for flag, given in (("--expect", args.expect), ("--no-gate", args.no_gate)):
            if given:
                raise UsageError(f"{flag} needs --lockstep")
        return None
    return LockStepOptions(tuple(args.expect), args.lockstep_timeout, not args.no_gate)


def parse_gap(text: str) -> tuple[int, int]:
    """(follower, leader) of FOLLOWER:LEADER. Raises UsageError."""
    follower, colon, leader = text.partition(":")
    if not colon:
        raise UsageError(f"--gap {text!r} is not FOLLOWER:LEADER, e.g. 1:0")
    return names.parse_robot_id(follower), names.parse_robot_id(leader)


def parse_addition(text: str) -> tuple[int, str, Pose2]:
    """(id, model, pose in `map`) of ID:MODEL:X:Y:YAW. Raises UsageError."""
    parts = text.split(":")
    try:
        robot_id, model, x, y, yaw = parts
    except ValueError:
        raise UsageError(f"--add {text!r} is not ID:MODEL:X:Y:YAW, e.g. 7:erratic:2.0:3.5:1.57") from None
    try:
        pose = Pose2(*(parse_number(word, -MAX_PLACE, MAX_PLACE, "metres and radians") for word in (x, y, yaw)))
        return names.parse_robot_id(robot_id), model, pose
    except UsageError as error:
        raise UsageError(f"--add {text!r}: {error}") from None


def _read(args: argparse.Namespace) -> tuple[str, Callable[[], SimOptions]]:
    """What the options say. Raises UsageError."""
    options = SimOptions(
        world=Path(args.world),
        seed=args.seed,
        map_resolution=args.map_resolution,
        has_map=not args.no_map,
        world_robots=not args.only_added,
        added=tuple(map(parse_addition, args.add)),
        follows=dict(map(parse_gap, args.gap)),
        engine=simulation_options(args),
        run_for=args.run_for,
        until=args.until,
        speed=parse_speed(args.speed or ("max" if args.lockstep else "1")),
        paused=args.paused,
        lockstep=lockstep_options(args),
    )
    # Once the log is there: a world that is not found is told as one that cannot be read.
    return names.SIMULATOR, lambda: msgspec.structs.replace(options, world=find_world(args.world))


main = partial(run_process, build_parser, _read)
