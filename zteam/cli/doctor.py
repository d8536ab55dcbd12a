"""`zteam doctor`: checks the router, the processes and the data; names cause and next step for every problem of now."""

import argparse
import sys
import textwrap
from collections.abc import Sequence
from pathlib import Path

import msgspec

from zteam.bus import Bus, BusOptions
from zteam.cli.doctor_facts import collect_facts
from zteam.cli.doctor_host import check_router, check_versions
from zteam.cli.interrupts import leave
from zteam.cli.listening import open_bus
from zteam.cli.live_line import has_color
from zteam.cli.options import Parser, add_bus_options, bus_options, run
from zteam.cli.tables import terminal_width
from zteam.diagnosis.finding import Finding, Level
from zteam.diagnosis.maps import check_map_file
from zteam.diagnosis.team import check_team
from zteam.numbers import counted
from zteam.services.simulator import MapInfo

_COLORS: dict[Level, int] = {"ok": 32, "note": 33, "problem": 31}
_NEXT = "-> "


def build_parser() -> argparse.ArgumentParser:
    """The command line."""
    parser = Parser(prog="zteam doctor", description=__doc__)
    parser.add_argument("--map", metavar="FILE.yaml", help="also compare this map_server file with the running world")
    parser.add_argument("--json", action="store_true", help="print the findings as JSON")
    add_bus_options(parser)
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point."""
    args = build_parser().parse_args(argv)
    return run("zteam doctor", args, lambda: _examine(args))


def _examine(args: argparse.Namespace) -> int:
    options = bus_options(args)
    map_file = None if args.map is None else _read_map(Path(args.map))
    router = check_router(options)
    findings = [check_versions(), router]
    if router.good:
        bus = open_bus(msgspec.structs.replace(options, connect=options.endpoint))
        try:
            findings += _team(bus, options, args.map, map_file)
        finally:
            bus.close()
    print(
        msgspec.json.encode(findings).decode()
        if args.json
        else format_findings(findings, has_color(sys.stdout), terminal_width())
    )
    return 0 if all(finding.good for finding in findings) else 1


def _team(bus: Bus, options: BusOptions, map_name: str | None, map_file: MapInfo | None) -> list[Finding]:
    facts = collect_facts(bus, options)
    found = check_team(facts)
    if map_name is not None and map_file is not None:
        found.append(check_map_file(map_name, map_file, facts.sim))
    return found


def _read_map(path: Path) -> MapInfo:
    from zteam.world.floor_maps import read_floor_map

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
        told = _wrap(finding.text, f"{finding.level:8}{finding.what:{width}}  ", indent, columns)
        if color:
            told[0] = f"\033[{_COLORS[finding.level]}m{finding.level}\033[0m{told[0][len(finding.level) :]}"
        lines += told
        if finding.next_step:
            lines += _wrap(finding.next_step, indent + _NEXT, indent + " " * len(_NEXT), columns)
    return "\n".join([*lines, _count(findings)])


def _wrap(text: str, first: str, rest: str, columns: int | None) -> list[str]:
    if columns is None or columns < len(rest) + 20:
        return [first + text]
    return textwrap.wrap(
        text, columns, initial_indent=first, subsequent_indent=rest, break_long_words=False, break_on_hyphens=False
    )


def _count(findings: Sequence[Finding]) -> str:
    problems = sum(not finding.good for finding in findings)
    return counted(problems, "problem") if problems else "no problems"


if __name__ == "__main__":
    leave(main())
