"""`zteam sim pause | resume | step | speed | reset | spawn | remove | move | status`: control the running simulator."""

import argparse
from collections.abc import Sequence
from functools import partial

import msgspec

from zteam import names
from zteam.cli.listening import open_bus
from zteam.cli.options import Parser, add_bus_options, add_json, add_option, option_type, parse_speed, run_tool
from zteam.clock import to_seconds
from zteam.config.numbers import parse_number
from zteam.config.robot_ids import format_robot_ids, parse_robot_ids
from zteam.errors import BusError, UsageError, printable
from zteam.geometry import FAR, turn_problem
from zteam.node.live_line import ProgressLine
from zteam.node.output import print_block, print_json
from zteam.simulator.client import MAX_TICKS, SimStatus, SimulatorClient, SpawnReply


def build_parser() -> Parser:
    parser = Parser(prog="zteam sim", description=__doc__)

    def verb(name: str, text: str) -> Parser:
        return parser.add_verb(name, _answer, text, add_json, add_bus_options)

    verb("pause", "pause the world")
    verb("resume", "continue the world")
    step, ticks = verb("step", "run N ticks, then pause"), (1, MAX_TICKS, "a number of ticks")
    add_option(step, "ticks", nargs="?", typed=ticks, default=1, metavar="N", help="ticks to run")
    text = "simulated seconds per host second, or max for as fast as possible"
    verb("speed", "set the pace").add_argument("speed", type=option_type(parse_speed), metavar="X|max", help=text)
    verb("reset", "return to the start: robots, bodies and time")
    spawn = verb("spawn", "add a robot to the world and print its id")
    spawn.add_argument("--pose", nargs=3, required=True, metavar=("X", "Y", "YAW"), help="pose in map: metres, radians")
    add_option(spawn, "--model", default="erratic", help="a model that the world file defines")
    robot_id = option_type(lambda text: names.parse_robot_id(text.strip()))
    spawn.add_argument("--id", type=robot_id, metavar="N", help="robot id (default: the lowest free one)")
    remove, text = verb("remove", "remove robots from the world"), "robot ids, e.g. 3, or 0,2-4"
    remove.add_argument("ids", nargs="+", metavar="ID", help=text)
    move = verb("move", "put a robot at another pose")
    move.add_argument("id", type=robot_id, metavar="ID", help="robot id")
    for name, unit in (("x", "metres"), ("y", "metres"), ("yaw", "radians")):
        move.add_argument(name, metavar=name.upper(), help=f"in map: {unit}")
    for sub in (spawn, move):
        sub.add_argument("--force", action="store_true", help="allow a pose in a wall or a robot, or outside the world")
    verb("status", "print time, pace, lock-step and robots")
    return parser


def _read(args: argparse.Namespace) -> None:
    if args.verb == "remove":
        args.ids = parse_robot_ids(args.ids, "remove")
    elif args.verb in ("spawn", "move"):
        args.pose = parse_pose(args.pose if args.verb == "spawn" else [args.x, args.y, args.yaw])


def _answer(args: argparse.Namespace) -> None:
    with open_bus(args) as bus:
        reply, text = _act(SimulatorClient(bus), args)
    print_json(reply) if args.json else print_block(text)


def parse_pose(words: Sequence[str]) -> tuple[float, float, float]:
    """(x, y, yaw) of the words X Y YAW: metres and radians. Raises UsageError."""
    try:
        x, y, yaw = (parse_number(word, -FAR, FAR, "a number") for word in words)
    except UsageError:
        pose, bounds = " ".join(word.strip() for word in words), f"from {-FAR:g} to {FAR:g}"
        raise UsageError(f"pose {pose!r}: give X Y YAW in metres and radians {bounds}") from None
    if problem := turn_problem(yaw):
        raise UsageError(f"YAW {problem}")
    return x, y, yaw


def _act(client: SimulatorClient, args: argparse.Namespace) -> tuple[msgspec.Struct, str]:
    """Carry out the verb; the simulator's reply, and its text for users."""
    match args.verb:
        case "pause":
            status = client.pause()
            hold = f", which waits for {printable(status.waiting_for)}" if status.waiting_for else ""
            return status, f"paused {_format_when(status)}{hold}"
        case "resume":
            status = client.resume()
            if status.finished:
                return status, f"the run is over {_format_when(status)}: 'zteam sim reset' starts it again"
            return status, f"resumed {_format_when(status)}, {_format_pace(status)}"
        case "speed":
            status = client.set_speed(args.speed)
            later = ", after 'zteam sim resume': the world is paused" if status.paused else ""
            return status, _format_pace(status) + later
        case "reset":
            status = client.reset()
            return status, f"reset, {'paused ' + _format_when(status) if status.paused else _format_pace(status)}"
        case "spawn":
            robot_id = client.spawn(*args.pose, model=args.model, robot_id=args.id, force=args.force)
            return SpawnReply(robot_id), str(robot_id)
        case "move":
            x, y, yaw = args.pose
            status = client.move(args.id, x, y, yaw, force=args.force)
            return status, f"robot {args.id} is at x {x:zg}, y {y:zg}, yaw {yaw:zg}"
        case "remove":
            status = _remove(client, args.ids)
            gone = f"robot {args.ids[0]} is" if len(args.ids) == 1 else f"robots {format_robot_ids(args.ids)} are"
            return status, f"{gone} removed; robots left: {format_robot_ids(status.robots) or '-'}"
        case _:
            status = _step(client, args.ticks) if args.verb == "step" else client.status()
            return status, format_status(status)


def _step(client: SimulatorClient, ticks: int) -> SimStatus:
    with ProgressLine() as progress:

        def report(status: SimStatus) -> None:
            progress.show(f"{_format_when(status)}, real-time factor {status.real_time_factor:.3g} (Ctrl+C pauses)")

        try:
            return client.step(ticks, on_progress=report)
        except KeyboardInterrupt:
            # The user gave up: cancel the remaining ticks.
            progress.say(f"paused {_format_when(client.pause())}")
            raise


def _remove(client: SimulatorClient, ids: Sequence[int]) -> SimStatus:
    for i, robot_id in enumerate(ids):
        try:
            status = client.remove(robot_id)
        except BusError as error:
            raise BusError(f"{error}; removed before: {format_robot_ids(ids[:i])}" if i else str(error)) from None
    return status


def format_status(status: SimStatus) -> str:
    paused = "run over" if status.finished else "yes" if status.paused else "no"
    rows = [
        ("world", f"{status.world}, seed {status.seed}"),
        ("time", f"{to_seconds(status.now):.3f} s"),
        ("tick", f"{status.tick}, {status.interval / 1e6:g} ms each"),
        ("speed", _format_pace(status)),
        ("real-time factor", f"{status.real_time_factor:.3g}"),
        ("paused", paused),
        ("lock-step", "yes" if status.lockstep else "no"),
    ]
    if status.lockstep:
        rows += [
            ("  participants", _listed(status.participants)),
            ("  joining", _listed(status.joining)),
            ("  waiting for", status.waiting_for or "-"),
            ("  hung", _listed(status.hung)),
        ]
    rows.append(("robots", format_robot_ids(status.robots) or "-"))
    return "\n".join(f"{name:18}{printable(value)}" for name, value in rows)


def _format_when(status: SimStatus) -> str:
    return f"at {to_seconds(status.now):.3f} s (tick {status.tick})"


def _format_pace(status: SimStatus) -> str:
    if status.speed is None:
        return "as fast as possible"
    return f"{status.speed:g} simulated second{'s' * (status.speed != 1.0)} a second"


def _listed(items: Sequence[object]) -> str:
    return ", ".join(map(str, items)) or "-"


main = partial(run_tool, build_parser, None, read=_read)
