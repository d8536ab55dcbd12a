"""`zteam log [NAME …]`: print the logs of a team's processes, merged in order of time, and follow them until Ctrl+C."""

import argparse
import fnmatch
import logging
import math
import sys
from collections.abc import Sequence
from functools import partial

import msgspec

from zteam.bus import Bus
from zteam.bus.graph import find_nodes
from zteam.cli.listening import Waiter, check_key, open_bus
from zteam.cli.options import Parser, add_bus_options, add_option, run_tool
from zteam.clock import local_time_text, monotonic
from zteam.errors import UsageError, ZteamError, printable
from zteam.names import is_wildcard
from zteam.node.live_line import has_color
from zteam.node.log_client import LogReader, level_name
from zteam.node.logs import LEVELS, LogLine
from zteam.node.output import Clean, print_json, print_line

_COLORS = ((logging.ERROR, 31), (logging.WARNING, 33), (logging.INFO, 0), (logging.NOTSET, 2))
"""(level, colour of its lines and of those above it): red, yellow, none, faint."""


def build_parser() -> Parser:
    parser = Parser(prog="zteam log", description=__doc__)
    text = "print only these processes, such as robot_1, sim, 'robot_*' (default: all)"
    parser.add_argument("names", nargs="*", metavar="NAME", help=text)
    text = "print lines from this level up (default: all that the processes log)"
    add_option(parser, "--level", choices=LEVELS, default="debug", help=text)
    text = "begin with the newest N lines (default: all that the processes keep)"
    add_option(parser, "-n", "--tail", typed=(0, 1_000_000, "lines"), metavar="N", help=text)
    until = parser.add_mutually_exclusive_group()
    until.add_argument("-f", "--follow", action="store_true", help="go on with new lines until Ctrl+C (the default)")
    until.add_argument("--once", action="store_true", help="print the lines that the processes keep, and end")
    parser.add_argument("--json", action="store_true", help="print JSON, one object per line")
    add_bus_options(parser)
    return parser


def _read(args: argparse.Namespace) -> None:
    args.names = [name_pattern(name) for name in args.names] or ["*"]


def name_pattern(text: str) -> str:
    """The part of a key that stands for the names that a user typed; `*` is any text. Raises UsageError."""
    pattern = check_key(text.replace("$*", "*").replace("*", "$*") if text != "*" else text)
    if "/" in pattern:
        raise UsageError(f"{text!r} is not the name of a process, such as robot_1, sim or 'robot_*'")
    return pattern


def format_line(line: LogLine, color: bool) -> Clean:
    """The line as its process prints it, with milliseconds; further lines of its text are indented."""
    level = "" if level_name(line.level) == "info" else f"{level_name(line.level)}: "
    millisecond = line.time_ns // 1_000_000 % 1000
    head = f"{local_time_text(line.time_ns)}.{millisecond:03d} [{line.process}] {level}"
    shown = printable((head + line.text).replace("\n", "\n    "), "\n\t")
    code = next(code for bound, code in _COLORS if line.level >= bound)
    return Clean(f"\033[{code}m{shown}\033[0m" if color and code else shown)


def format_json(line: LogLine) -> bytes:
    """The line as one JSON object, with the name of its level."""
    return msgspec.json.encode({**msgspec.structs.asdict(line), "level": level_name(line.level)})


def _log(args: argparse.Namespace) -> None:
    waiter = Waiter()
    with open_bus(args) as bus:
        reader = LogReader(bus, args.names, waiter.notify, logging.getLevelName(args.level.upper()))
        if not args.once:
            reader.follow()
        found = _fetch(bus, reader, args.names)
        kept = reader.ready(math.inf)
        _print(kept if args.tail is None else kept[max(0, len(kept) - args.tail) :], args.json)
        if not args.once:
            _follow(reader, waiter, args.json, found)
        elif not found:
            print_line("no processes (start a team with 'zteam up')", file=sys.stderr)


def _fetch(bus: Bus, reader: LogReader, patterns: Sequence[str]) -> bool:
    """Take what the processes keep; whether there are any. Raises ZteamError for an unknown name."""
    answered = reader.fetch()
    silent = [pattern for pattern in patterns if not any(_matches(pattern, name) for name in answered)]
    if not silent:
        return True
    alive = sorted({node.name for node in find_nodes(bus)})
    if unknown := [pattern for pattern in silent if not is_wildcard(pattern) and pattern not in alive]:
        living = f"alive: {', '.join(alive)}" if alive else "none is alive (start a team with 'zteam up')"
        raise ZteamError(f"no process {', '.join(unknown)}; {living}")
    quiet = [name for name in alive if any(_matches(pattern, name) for pattern in silent)]
    for name in quiet:
        print_line(f"{name} does not answer: only its new lines are shown", file=sys.stderr)
    return bool(answered or quiet)


def _matches(pattern: str, name: str) -> bool:
    return fnmatch.fnmatchcase(name, pattern.replace("$*", "*"))


def _follow(reader: LogReader, waiter: Waiter, as_json: bool, found: bool) -> None:
    """Print new lines, and those that joining processes keep, until Ctrl+C."""
    while True:
        waiter.wait(reader.pending, None, "" if found else "a process")
        found = bool(reader.fetch_joined()) or found
        # Older lines of other processes may still be on their way.
        waiter.wait(lambda: reader.left(monotonic()) == 0.0, reader.left(monotonic()), "")
        _print(reader.ready(monotonic()), as_json)


def _print(lines: Sequence[LogLine], as_json: bool) -> None:
    color = has_color(sys.stdout)
    print_json(*map(format_json, lines)) if as_json else print_line(*(format_line(line, color) for line in lines))


main = partial(run_tool, build_parser, _log, read=_read)
