"""`zteam doctor`: checks the router, the processes and the data; names cause and next step for every problem of now."""

import argparse
import sys
import textwrap
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from zteam.cli.interrupts import raise_from_now
from zteam.cli.live_line import has_color
from zteam.cli.options import Parser, add_bus_options, bus_options, run_tool
from zteam.cli.output import Clean, painted, print_block, print_json
from zteam.cli.tables import terminal_width
from zteam.config.map_files import read_floor_map
from zteam.config.numbers import counted
from zteam.errors import printable
from zteam.monitor.doctor.examination import examine
from zteam.monitor.doctor.facts import Finding, Level
from zteam.simulator.client import MapInfo

_COLORS: dict[Level, int] = {"ok": 32, "note": 33, "problem": 31}
_NEXT = "-> "


def build_parser() -> Parser:
    parser = Parser(prog="zteam doctor", description=__doc__)
    parser.add_argument("--map", metavar="FILE.yaml", help="also compare this map_server file with the running world")
    parser.add_argument("--json", action="store_true", help="print the findings as JSON")
    add_bus_options(parser)
    return parser


def _examine(args: argparse.Namespace) -> int:
    options = bus_options(args)
    map_file = None if args.map is None else (args.map, _read_map(Path(args.map)))
    raise_from_now()
    findings = examine(options, map_file)
    if args.json:
        print_json(findings)
    else:
        print_block(format_findings(findings, has_color(sys.stdout), terminal_width()))
    return 0 if all(finding.good for finding in findings) else 1


def _read_map(path: Path) -> MapInfo:
    found = read_floor_map(path)
    rows, columns = found.occupied.shape
    x, y, yaw = found.map_from_corner
    return MapInfo(x, y, yaw, found.resolution, columns, rows)


def format_findings(findings: Sequence[Finding], color: bool = False, columns: int | None = None) -> str:
    """The findings in columns, and a last line that counts what is wrong."""
    width = max(len(finding.what) for finding in findings)
    indent = " " * (width + 10)
    lines = []
    for finding in findings:
        head = f"{finding.level:8}{printable(finding.what):{width}}  "
        told = _wrap(printable(finding.text), head, indent, columns)
        if color:
            told[0] = f"{painted(finding.level, _COLORS[finding.level])}{told[0][len(finding.level) :]}"
        lines += told
        if finding.next_step:
            lines += _wrap(printable(finding.next_step), indent + _NEXT, indent + " " * len(_NEXT), columns)
    problems = sum(not finding.good for finding in findings)
    return Clean("\n".join([*lines, counted(problems, "problem") if problems else "no problems"]))


def _wrap(text: str, first: str, rest: str, columns: int | None) -> list[str]:
    if columns is None or columns < len(rest) + 20:
        return [first + text]
    return textwrap.wrap(
        text, columns, initial_indent=first, subsequent_indent=rest, break_long_words=False, break_on_hyphens=False
    )


main = partial(run_tool, build_parser, _examine)
