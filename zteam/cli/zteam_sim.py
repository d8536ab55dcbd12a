"""`zteam-sim WORLD`: run the simulator. It reads Stage's world files; a robot's id is its place in the file."""

import argparse
from collections.abc import Callable
from functools import partial
from pathlib import Path

import msgspec

from zteam import names
from zteam.cli.arguments import add_options, add_repeated, parse_speed, read_options
from zteam.cli.options import Parser, add_bus_options, run_process
from zteam.config.numbers import parse_number
from zteam.config.resources import find_world
from zteam.config.simulation_options import LockStepOptions, Options, SimOptions
from zteam.errors import UsageError
from zteam.geometry import Pose2
from zteam.simulator.client import MAX_PLACE


def build_parser() -> Parser:
    parser = Parser(prog="zteam-sim", description=__doc__)
    parser.add_argument("world", metavar="WORLD", help="a .world file, or the name of a shipped world such as office")
    add_options(parser, SimOptions, "seed", "map_resolution", "has_map")
    robots = parser.add_argument_group("robots")
    text = "add a robot to the world's own, e.g. 7:erratic:2.0:3.5:1.57"
    add_repeated(robots, "--add", "ID:MODEL:X:Y:YAW", text)
    add_options(robots, SimOptions, "world_robots")
    add_repeated(robots, "--gap", "FOLLOWER:LEADER", "measure the gap between two robots, e.g. 1:0")
    time = parser.add_argument_group("time (docs/time.md)")
    add_options(time, SimOptions, "run_for", "until", "speed", "paused")
    time.add_argument("--lockstep", action="store_true", help="begin a tick when every participant has answered")
    add_options(time, LockStepOptions)
    add_options(parser.add_argument_group("contacts and sensors (docs/simulator.md)"), Options)
    add_bus_options(parser)
    return parser


def simulation_options(args: argparse.Namespace) -> Options:
    """The simulation options of a parsed command line. Raises UsageError."""
    try:
        alphas = None if args.odom_alphas is None else tuple(map(float, args.odom_alphas.split(",")))
        if alphas is not None and len(alphas) != 4:
            raise ValueError("--odom-alphas takes four numbers, such as 0.05,0.01,0.02,0.01")
        return read_options(Options, args, odom_alphas=alphas)
    except ValueError as error:
        raise UsageError(str(error)) from None


def lockstep_options(args: argparse.Namespace) -> LockStepOptions | None:
    """The lock-step options of a parsed command line; None without `--lockstep`. Raises UsageError."""
    if args.lockstep:
        return read_options(LockStepOptions, args)
    for flag, given in (("--expect", args.expected), ("--no-gate", not args.gate)):
        if given:
            raise UsageError(f"{flag} needs --lockstep")
    return None


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
    options = read_options(
        SimOptions,
        args,
        world=Path(args.world),
        added=tuple(map(parse_addition, args.add)),
        follows=dict(map(parse_gap, args.gap)),
        engine=simulation_options(args),
        speed=parse_speed(args.speed or ("max" if args.lockstep else "1")),
        lockstep=lockstep_options(args),
    )
    # Once the log is there: a world that is not found is told as one that cannot be read.
    return names.SIMULATOR, lambda: msgspec.structs.replace(options, world=find_world(args.world))


main = partial(run_process, build_parser, _read)
