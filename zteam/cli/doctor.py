"""`zteam doctor`: checks the router, the processes and the data; names cause and next step for every problem of now."""

import argparse
import re
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from zteam.cli.interrupts import raise_from_now
from zteam.cli.options import Parser, add_bus_options, bus_options, run_tool
from zteam.cli.tables import format_table, terminal_width
from zteam.config.map_files import read_floor_map
from zteam.config.numbers import counted
from zteam.monitor.doctor.examination import examine
from zteam.monitor.doctor.facts import Finding
from zteam.node.live_line import has_color
from zteam.node.output import Clean, painted, print_block, print_json
from zteam.simulator.client import MapInfo

_COLORS = {"ok": 32, "note": 33, "problem": 31}


def build_parser() -> Parser:
    parser = Parser(prog="zteam doctor", description=__doc__)
    parser.add_argument("--map", metavar="FILE.yaml", help="also compare this map_server file with the running world")
    parser.add_argument("--json", action="store_true", help="print the findings as JSON")
    add_bus_options(parser)
    return parser


def _examine(args: argparse.Namespace) -> int:
    options = bus_options(args)
    map_file = None
    if args.map is not None:
        found = read_floor_map(Path(args.map))
        rows, columns = found.occupied.shape
        map_file = args.map, MapInfo(*found.map_from_corner, found.resolution, columns, rows)
    raise_from_now()
    findings = examine(options, map_file)
    text = format_findings(findings, has_color(sys.stdout), terminal_width())
    print_json(findings) if args.json else print_block(text)
    return 0 if all(finding.good for finding in findings) else 1


def format_findings(findings: Sequence[Finding], color: bool = False, columns: int | None = None) -> str:
    """The findings in columns, and a last line that counts what is wrong."""
    rows: list[tuple[str, ...]] = []
    for finding in findings:
        rows.append((finding.level, finding.what, finding.text))
        if finding.next_step:
            rows.append(("", "", f"-> {finding.next_step}"))
    text = format_table(rows[0], rows[1:], width=columns)
    if color:
        # Only the first line of a finding begins with its level.
        text = re.sub("^[a-z]+", lambda level: painted(level[0], _COLORS[level[0]]), text, flags=re.MULTILINE)
    problems = sum(not finding.good for finding in findings)
    return Clean(f"{text}\n{counted(problems, 'problem') if problems else 'no problems'}")


main = partial(run_tool, build_parser, _examine)
