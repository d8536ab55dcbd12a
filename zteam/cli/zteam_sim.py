"""`zteam-sim WORLD`: the simulator. Stage's world files run as they are; a robot's id is its place in the file."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from zteam import names
from zteam.cli.options import MAX_SEED, MIN_SEED, Parser, add_bus_options, bus_options, number, run, whole
from zteam.errors import UsageError, ZteamError
from zteam.geometry import Pose2
from zteam.numbers import MAX_SECONDS, parse_number
from zteam.resources import names as shipped_names
from zteam.resources import shipped_world, worlds_folder
from zteam.services.simulator import MAX_PLACE, MAX_SPEED, MIN_SPEED
from zteam.simulation_options import PHYSICS, Options

if TYPE_CHECKING:
    from zteam.nodes.simulator.lockstep import LockStepOptions

MIN_RUN = 1e-6
"""Simulated seconds of the shortest `--for`: it ends with the tick of GO."""
LOCKSTEP_TIMEOUTS = (1e-3, 3600.0)
"""Host seconds."""


def build_parser() -> argparse.ArgumentParser:
    """The command line."""
    parser = Parser(prog="zteam-sim", description=__doc__)
    parser.add_argument("world", metavar="WORLD", help="a .world file, or the name of a shipped world such as office")
    parser.add_argument(
        "--seed",
        type=whole(MIN_SEED, MAX_SEED, "a seed"),
        default=1,
        help="seed of everything random (default: %(default)s)",
    )
    parser.add_argument(
        "--map-resolution",
        type=number(1e-4, 1e4, "metres a cell"),
        default=0.05,
        metavar="M",
        help="metres a cell of the published map (0.05)",
    )
    parser.add_argument(
        "--add",
        action="append",
        default=[],
        metavar="ID:MODEL:X:Y:YAW",
        help="add a robot that the world lacks, e.g. 7:erratic:2.0:3.5:1.57",
    )
    parser.add_argument("--only-added", action="store_true", help="leave the world's own robots out")
    parser.add_argument(
        "--gap", action="append", default=[], metavar="FOLLOWER:LEADER", help="measure the gap of two robots, e.g. 1:0"
    )
    parser.add_argument(
        "--for",
        dest="run_for",
        type=number(MIN_RUN, MAX_SECONDS, "simulated seconds"),
        metavar="SECONDS",
        help="stand still this many simulated seconds after GO (and go on answering queries)",
    )
    _add_time_options(parser)
    parser.add_argument(
        "--compile-only", action="store_true", help="compile the simulator's kernels into the cache, then end"
    )
    _add_simulation_options(parser)
    add_bus_options(parser)
    return parser


def parse_speed(text: str) -> float | None:
    """Simulated seconds a second: a number, or None for `max`. Raises UsageError."""
    if text == "max":
        return None
    try:
        return parse_number(text, MIN_SPEED, MAX_SPEED, "simulated seconds a second")
    except UsageError as error:
        raise UsageError(f"speed {error}, or max") from None


def _add_time_options(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("time (docs/time.md)")
    group.add_argument("--speed", metavar="X", help="simulated seconds a second, or max (default: 1; max in lock-step)")
    group.add_argument("--paused", action="store_true", help="stand still at the first tick ('zteam sim resume')")
    group.add_argument("--lockstep", action="store_true", help="a tick begins when every participant has answered")
    group.add_argument(
        "--lockstep-timeout",
        type=number(*LOCKSTEP_TIMEOUTS, "host seconds"),
        default=10.0,
        metavar="SECONDS",
        help="leave a living participant behind that does not answer for so long (10)",
    )
    group.add_argument(
        "--expect",
        nargs="+",
        default=[],
        metavar="NAME",
        help="hold the first tick until these take part, e.g. tf robot_0 planner",
    )
    group.add_argument("--no-gate", action="store_true", help="in lock-step, do not wait for the monitor's GO")


def _add_simulation_options(parser: argparse.ArgumentParser) -> None:
    """One flag for every field of `zteam.simulation_options.Options`."""
    group = parser.add_argument_group("contacts and sensors")
    group.add_argument(
        "--physics", choices=PHYSICS, help="what contacts do (default: what the world says, else dynamic)"
    )
    group.add_argument("--no-hit", choices=("range_max", "inf"), help="what a beam reads that hits nothing (range_max)")
    group.add_argument(
        "--below-min", choices=("measured", "-inf", "zero"), help="what a beam reads below range_min (measured)"
    )
    group.add_argument("--gaussian-noise", type=float, metavar="M", help="standard deviation of all lasers in metres")
    group.add_argument("--proportional-noise", type=float, metavar="SHARE", help="standard deviation by range")
    group.add_argument(
        "--odom-alphas", metavar="A1,A2,A3,A4", help="noise of all odometry (Thrun), such as 0.05,0.01,0.02,0.01"
    )
    group.add_argument(
        "--dazzle",
        choices=("off", "drop", "max", "short", "scan"),
        help="what lasers in mutual sight do to each other (off)",
    )
    group.add_argument("--dazzle-angle", type=float, metavar="RAD", help="to either side of the other laser (0.035)")
    group.add_argument("--dazzle-probability", type=float, metavar="P", help="share of the scans (1)")


def simulation_options(args: argparse.Namespace) -> Options:
    """What a parsed command line says about contacts and sensors."""
    given = {name: getattr(args, name) for name in Options.__struct_fields__ if getattr(args, name) is not None}
    try:
        if "odom_alphas" in given:
            given["odom_alphas"] = tuple(map(float, given["odom_alphas"].split(",")))
            if len(given["odom_alphas"]) != 4:
                raise ValueError("--odom-alphas takes four numbers, such as 0.05,0.01,0.02,0.01")
        return Options(**given)
    except ValueError as error:
        raise UsageError(str(error)) from None


def lockstep_options(args: argparse.Namespace) -> "LockStepOptions | None":
    """What a parsed command line says about lock-step."""
    from zteam.nodes.simulator.lockstep import LockStepOptions

    if not args.lockstep:
        for flag, given in (("--expect", args.expect), ("--no-gate", args.no_gate)):
            if given:
                raise UsageError(f"{flag} needs --lockstep")
        return None
    return LockStepOptions(tuple(args.expect), args.lockstep_timeout, not args.no_gate)


def find_world(text: str) -> Path:
    """The world file named on a command line: a path, else a shipped world."""
    path = Path(text)
    if path.is_file():
        return path
    shipped = shipped_world(text)
    if shipped is None:
        known = ", ".join(shipped_names(worlds_folder(), ".world"))
        raise UsageError(f"world {text!r}: no such file, nor a shipped world ({known})")
    return shipped


def parse_gap(text: str) -> tuple[int, int]:
    """FOLLOWER:LEADER."""
    follower, colon, leader = text.partition(":")
    if not colon:
        raise UsageError(f"--gap {text!r} is not FOLLOWER:LEADER, e.g. 1:0")
    return names.parse_robot_id(follower), names.parse_robot_id(leader)


def parse_addition(text: str) -> tuple[int, str, Pose2]:
    """ID:MODEL:X:Y:YAW."""
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


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point."""
    args = build_parser().parse_args(argv)
    return run(names.SIMULATOR, args, lambda: _simulate(args))


def _simulate(args: argparse.Namespace) -> int:
    from zteam.nodes.simulator.node import SimOptions, run_simulator
    from zteam.runtime.node import Node
    from zteam.runtime.process import run_node
    from zteam.sim.takeover import begin, fill_cache, prepare
    from zteam.world import add_robot, load_world

    lockstep = lockstep_options(args)
    speed = parse_speed(args.speed or ("max" if lockstep else "1"))
    world = load_world(find_world(args.world))
    robots = {} if args.only_added else dict(enumerate(world.robots))
    for robot_id, model, pose in map(parse_addition, args.add):
        if robot_id in robots:
            raise UsageError(f"--add {robot_id}: the world has a robot {robot_id} already")
        robots[robot_id] = add_robot(world, model, pose, names.robot_name(robot_id))
    if args.compile_only:
        if reason := fill_cache():
            raise ZteamError(f"the kernels are not in the cache: {reason}")
        return 0
    # A run in lock-step keeps the kernels it begins with: what it does must not depend on when they are ready.
    later = None if lockstep else begin()
    if lockstep:
        prepare()
    options = SimOptions(
        world=Path(args.world),
        seed=args.seed,
        map_resolution=args.map_resolution,
        follows=dict(map(parse_gap, args.gap)),
        run_for=args.run_for,
        engine=simulation_options(args),
        speed=speed,
        paused=args.paused,
        lockstep=lockstep,
    )

    def body(node: Node) -> None:
        run_simulator(node, world, robots, options, later)

    return run_node(names.SIMULATOR, bus_options(args), body)


if __name__ == "__main__":
    sys.exit(main())
