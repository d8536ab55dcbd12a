"""`zteam world check | show | scan | new FILE`: check and draw worlds, print a robot's scans, make one of a picture."""

import argparse
import math
from functools import partial
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Any

import msgspec

from zteam.cli.options import Parser, add_log_options, add_option, run_tool
from zteam.config.map_files import MAX_RESOLUTION
from zteam.config.numbers import counted
from zteam.config.resources import find_world
from zteam.config.simulation_options import Options
from zteam.errors import UsageError
from zteam.geometry import FAR, Pose2
from zteam.messages import to_plain
from zteam.messages.base import LIMITS
from zteam.names import BASE_SCAN, MAX_ROBOT_ID
from zteam.node.output import print_json, print_line
from zteam.simulator.world import Robot, World, load_world
from zteam.simulator.world.bodies import read_bitmap
from zteam.simulator.world.builder import ERRATIC
from zteam.simulator.world.devices import KINDS
from zteam.simulator.world.model import base_info
from zteam.simulator.world.placing import find_misplaced, find_places, least_cell

if TYPE_CHECKING:
    from zteam.simulator.core import RobotObservation
    from zteam.simulator.world.drawing import Fan


def build_parser() -> Parser:
    parser = Parser(prog="zteam world", description=__doc__)
    check = parser.add_verb("check", _check, "load a world; list its models and what is ignored")
    show = parser.add_verb("show", _show, "draw a world and its robots")
    show.add_argument("-o", "--output", required=True, metavar="FILE.svg|png", help="picture to write")
    show.add_argument("--scan", action="store_true", help="draw what the lasers see")
    add_option(show, "--width", typed=(16, 20_000, "pixels"), default=1200, metavar="PIXELS", help="width")
    scan = parser.add_verb("scan", _scan, "print what the lasers of one robot measure")
    robot, text = (0, MAX_ROBOT_ID, "a robot id"), "robot id: its place in the file"
    add_option(scan, "--robot", typed=robot, required=True, metavar="N", help=text)
    pose, text = (-FAR, FAR, "metres and degrees"), "put it here, in map: metres, degrees (default: as in the file)"
    add_option(scan, "--pose", typed=pose, nargs=3, metavar=("X", "Y", "YAW_DEG"), help=text)
    for sub in (check, show, scan):
        sub.add_argument("world", metavar="FILE", help="a .world file, a map_server .yaml, or a shipped world")
        sub.add_argument("--whole-bitmaps", action="store_true", help="do not crop the margins of bitmaps")
        add_log_options(sub, "warning")
    new = parser.add_verb("new", _new, "make a world file and a team file of a picture of a plan", add_log_options)
    new.add_argument("picture", type=Path, metavar="PICTURE", help="PNG, PGM, BMP, JPEG or GIF: dark pixels are walls")
    metres, number = (1e-6, MAX_RESOLUTION, "metres a pixel"), (1, MAX_ROBOT_ID + 1, "a number")
    add_option(new, "--resolution", typed=metres, required=True, metavar="METRES", help="of a pixel, such as 0.05")
    add_option(new, "--robots", typed=number, default=4, metavar="N", help="robots in its free room (default: 4)")
    new.add_argument("-o", "--output", type=Path, metavar="FILE.world", help="default: beside the picture, as its name")
    new.add_argument("--force", action="store_true", help="overwrite files")
    for sub in (check, scan):
        sub.add_argument("--json", action="store_true", help="print JSON")
    return parser


def _run(args: argparse.Namespace) -> int:
    if args.verb == "new":
        return _new(args)
    code: int = args.act(args, load_world(find_world(args.world), whole_bitmaps=args.whole_bitmaps))
    return code


def _new(args: argparse.Namespace) -> int:
    """Write a world of the whole picture with robots in it, and a team of them that wanders."""
    from zteam.cli.new import TEMPLATES, fill, write_files

    picture, metres, robots = args.picture, args.resolution, args.robots
    chosen = args.output or picture
    if chosen.is_dir():
        chosen /= picture.name
    if not chosen.parent.is_dir():
        raise UsageError(f"-o {chosen}: there is no folder {chosen.parent}: make it first")
    files = [chosen.parent / f"{chosen.stem}.{suffix}" for suffix in ("world", "toml")]
    name = picture.name if picture.parent.resolve() == chosen.parent.resolve() else str(picture.resolve())
    for given, text in ((picture, name), (f"-o {chosen}", chosen.stem)):
        if not text.isprintable() or set(text) & set('"\\$'):
            raise UsageError(f"{given}: world and team files cannot hold a name with a quote or a $: give another")
    occupied = read_bitmap(picture)
    height, width = (round(count * metres, 9) for count in occupied.shape)
    size, places = f"{width:g} x {height:g} m", find_places(occupied, metres, robots)
    if occupied.min() == occupied.max():
        raise UsageError(f"{picture}: {'no' if occupied.any() else 'all'} free room: draw dark walls on a light ground")
    if len(places) < robots:
        is_negative = len(find_places(~occupied, metres, robots)) == robots
        way_out = "invert it" if is_negative else "give another --resolution, or fewer --robots"
        text = f"{picture}: {size} with dark walls, and free room for {len(places)} of {robots} robots"
        raise UsageError(f"{text}: {way_out}")
    words = {
        "picture": name, "metres": f"{metres:g}", "width": width, "height": height, "x": width / 2, "y": height / 2,
        "erratic": ERRATIC, "robots": "\n".join(f"erratic ( pose [{x!r} {y!r} 0 0] )" for x, y in places),
        "world": files[0].name, "last": robots - 1, "cell": max(Options().map_resolution, least_cell(width, height)),
    }  # fmt: skip
    texts = {path: fill((TEMPLATES / f"{path.suffix[1:]}.txt").read_text("utf-8"), words) for path in files}
    write_files(texts, "choose another name with -o, or overwrite it with --force", overwrite=args.force)
    print_line(f"wrote {' and '.join(map(str, files))}: {size}, {counted(robots, 'robot')}")
    print_line(f"next: zteam up {quote(str(files[1]))} --view")
    return 0


def _check(args: argparse.Namespace, world: World) -> None:
    summary = _summary(world)
    if args.json:
        print_json(summary)
        return
    print_line(f"{world.name}: a tick every {world.interval / 1e6:g} ms, {world.physics} physics")
    for plan in summary["floorplans"]:
        (w, h), (columns, rows) = plan["extent"], plan["cells"]
        _print_row("floor plan", plan["name"], f"{columns} x {rows} cells, {w:g} x {h:g} m")
        if plan["picture"] != plan["cells"]:
            text = 'cropped from {} x {} pixels (bitmap_reading "whole" keeps the margins)'
            _print_row("", "", text.format(*plan["picture"]))
    for obstacle in summary["obstacles"]:
        kind = "obstacle" if obstacle["mass"] is None else "pushable"
        _print_row(kind, obstacle["name"], f"at {_place(obstacle)}, {counted(obstacle['shapes'], 'shape')}")
    for robot in summary["robots"]:
        sensors = ", ".join(robot["sensors"]) or "no sensors"
        text = f"at {_place(robot)}: {robot['model']}, {robot['drive']}, {sensors}"
        _print_row(f"robot {robot['id']}", robot["name"], text)
    for base in summary["bases"]:
        _print_row("base", base["model"], _footprint_text(base))
        absent = dict.fromkeys(("max_vel_y", "wheelbase"), 0.0)
        limits = [f"{name} {base[name]:.3g}" for name in LIMITS if base[name] not in (None, absent.get(name))]
        if limits:
            _print_row("", "", ", ".join(limits))
    warnings = summary["warnings"]
    print_line(*warnings)
    nouns = {"robot": world.robots, "obstacle": world.obstacles, "floor plan": world.floorplans}
    counts = ", ".join(counted(len(things), noun) for noun, things in nouns.items())
    print_line(f"{counts}; {counted(len(warnings), 'warning') if warnings else 'no warnings'}")


def _print_row(kind: str, name: str, text: str) -> None:
    print_line(f"  {kind:10} {name:18} {text}")


def _place(thing: dict[str, Any]) -> str:
    x, y, yaw_deg = thing["pose"]
    return f"{x:z.3f} {y:z.3f}, {yaw_deg:z.1f}°"


def _summary(world: World) -> dict[str, Any]:
    misplaced = [
        f"{world.name}: robot {robot_id} ({world.robots[robot_id].name!r}) has no room at its pose: {hindrance}; "
        "a team with this robot does not start"
        for robot_id, hindrance in find_misplaced(world)
    ]
    return {
        "name": world.name,
        "interval_ms": world.interval / 1e6,
        "physics": world.physics,
        "floorplans": [
            {
                "name": plan.name,
                "cells": list(plan.occupied.shape[::-1]),
                "picture": list(plan.picture[::-1]),
                "cell": list(plan.cell),
                "extent": [n * c for n, c in zip(plan.occupied.shape[::-1], plan.cell, strict=True)],
            }
            for plan in world.floorplans
        ],
        "obstacles": [
            {"name": o.name, "pose": _degrees(o.pose), "mass": o.mass, "shapes": len(o.shapes)} for o in world.obstacles
        ],
        "robots": [
            {
                "id": robot_id,
                "name": robot.name,
                "model": robot.model,
                "pose": _degrees(robot.pose),
                "drive": robot.drive,
                "sensors": _sensors(robot),
            }
            for robot_id, robot in enumerate(world.robots)
        ],
        "bases": _bases(world),
        "warnings": [*map(str, world.warnings), *misplaced],
    }


def _bases(world: World) -> list[dict[str, Any]]:
    """What `base_info` tells of the robots: each kind of base once, in file order."""
    found: list[dict[str, Any]] = []
    for robot in world.robots:
        base = to_plain(base_info(robot))
        base["footprint"] = [[round(point["x"], 6), round(point["y"], 6)] for point in base["footprint"]["points"]]
        if base not in found:
            found.append(base)
    return found


def _footprint_text(base: dict[str, Any]) -> str:
    corners = base["footprint"]
    if not corners:
        return "no footprint"
    (left, right), (low, high) = ((min(side), max(side)) for side in zip(*corners, strict=True))
    return f"footprint x {left:.3g} to {right:.3g}, y {low:.3g} to {high:.3g} m"


def _sensors(robot: Robot) -> list[str]:
    seen = [ranger for ranger in robot.rangers if ranger.is_laser]
    lasers = [f"laser {r.samples} x {math.degrees(r.fov):.0f}° to {r.range_max:g} m" for r in seen]
    others = [(len(kind.of(robot)), kind.title) for kind in KINDS.values() if kind.topic != BASE_SCAN]
    return lasers + [counted(count, title) for count, title in others if count and title]


def _degrees(pose: Pose2) -> list[float]:
    return [pose.x, pose.y, math.degrees(pose.yaw)]


def _show(args: argparse.Namespace, world: World) -> None:
    from zteam.simulator.world.drawing import draw_world

    fans: dict[int, list[Fan]] = {}
    if args.scan:
        from zteam.simulator.core import Engine

        fans = {robot_id: _fans(seen) for robot_id, seen in Engine(world).observe().robots.items()}
    draw_world(world, Path(args.output), width=args.width, fans=fans)
    print_line(f"{args.output}: {world.name}, {counted(len(world.robots), 'robot')}")


def _fans(seen: "RobotObservation") -> "list[Fan]":
    from zteam.simulator.world.drawing import Fan

    found = []
    for ranger, reading in zip(seen.robot.rangers, seen.readings, strict=True):
        at = seen.truth.compose(Pose2(ranger.x, ranger.y, ranger.yaw))
        first = -ranger.fov / 2 if ranger.samples > 1 else 0.0
        angles = [at.yaw + first + i * ranger.angle_increment for i in range(ranger.samples)]
        ranges = reading.ranges.tolist()
        ends = [(at.x + r * math.cos(a), at.y + r * math.sin(a)) for r, a in zip(ranges, angles, strict=True)]
        found.append(Fan((at.x, at.y), ends, [r < ranger.range_max for r in ranges]))
    return found


def _scan(args: argparse.Namespace, world: World) -> None:
    from zteam.simulator.core import Engine

    if not 0 <= args.robot < len(world.robots):
        known = ", ".join(map(str, range(len(world.robots)))) or "none"
        raise UsageError(f"--robot {args.robot}: {world.name} has these robots: {known}")
    robots = dict(enumerate(world.robots))
    if args.pose is not None:
        x, y, yaw_deg = args.pose
        pose = Pose2(x, y, math.radians(yaw_deg))
        robots[args.robot] = msgspec.structs.replace(robots[args.robot], pose=pose)
    seen = Engine(world, robots=robots).observe().robots[args.robot]
    lasers = [
        {
            "name": ranger.name,
            "angle_min": -ranger.fov / 2 if ranger.samples > 1 else 0.0,
            "angle_increment": ranger.angle_increment,
            "range_min": ranger.range_min,
            "range_max": ranger.range_max,
            "ranges": reading.ranges.tolist(),
            "intensities": reading.intensities.tolist(),
        }
        for ranger, reading in zip(seen.robot.rangers, seen.readings, strict=True)
    ]
    if args.json:
        print_json({"robot": args.robot, "pose": _degrees(seen.truth), "lasers": lasers})
        return
    for laser in lasers:
        ranges = laser["ranges"]
        hits = sum(r < laser["range_max"] for r in ranges)
        print_line(
            f"{laser['name']:24} {len(ranges):5} beams  min {min(ranges):7.3f}  mean {sum(ranges) / len(ranges):7.3f}"
            f"  max {max(ranges):7.3f} m  {counted(hits, 'hit')}"
        )


main = partial(run_tool, build_parser, _run)
