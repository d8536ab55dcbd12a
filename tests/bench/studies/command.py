"""Which studies there are, and what each one prints."""

import argparse
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import msgspec

from studies.chains.figures import ROWS as CHAINS
from studies.chains.figures import measure_chains
from studies.chains.tables import format_robots
from studies.faults import measure_faults
from studies.floor import format_floor, measure_floor_of
from studies.formations import measure_formations
from studies.freezes import MODES, PROCESSES, SECONDS, format_freezes, measure_freezes
from studies.hops import format_hops, measure_hops_in
from studies.navigation.figures import ROWS as NAVIGATION
from studies.navigation.figures import measure_navigation
from studies.navigation.tables import format_navigation
from studies.navigation.team_rows import TEAM_ROWS
from studies.recovery import ROWS as FAULTS
from studies.recovery import format_recovery, measure_recovery
from studies.secure import format_secure, measure_secure
from studies.steps import format_steps, measure_steps
from studies.study import command as lines
from studies.view.figures import PARTS, measure_view
from studies.view.tables import format_view
from zteam.cli.arguments import number, whole
from zteam.cli.interrupts import raise_from_now
from zteam.cli.live_line import LiveLine, has_live_line
from zteam.cli.options import Parser, add_log_options, run
from zteam.config.resources import find_world

FORMATIONS = "formations"
"""The row of `robots` with all shapes (studies.formations)."""

Shown = tuple[Any, str]
"""What a study found, for JSON, and the same as text."""


def build_parser() -> argparse.ArgumentParser:
    """The command line."""
    parser = Parser(prog="studies", description=__doc__)
    studies = parser.add_subparsers(dest="study", required=True, metavar="|".join(STUDIES))
    for name, (text, add, _) in STUDIES.items():
        sub = studies.add_parser(name, help=text)
        add(sub)
        sub.add_argument("--json", action="store_true", help="print JSON")
        add_log_options(sub, "warning")
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point."""
    args = build_parser().parse_args(argv)
    return run("studies", args, lambda: _measure(args))


def _measure(args: argparse.Namespace) -> int:
    # The processes started here have to be ended.
    raise_from_now()
    found, text = STUDIES[args.study][2](args)
    print(msgspec.json.encode(found).decode() if args.json else text)
    return lines.exit_code(found) if args.study == "lines" else 0


@contextmanager
def _live() -> Iterator[Callable[[str], None]]:
    """Shows a text on the terminal's last line."""
    if not has_live_line(sys.stderr):
        yield lambda _text: None
        return
    with LiveLine(sys.stderr) as live:
        yield live.show


def _add_rows(parser: argparse.ArgumentParser, option: str, rows: Sequence[str]) -> None:
    parser.add_argument(
        option, nargs="+", choices=rows, default=rows, metavar="ROW", help=f"only these ({', '.join(rows)})"
    )


def _add_world(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("world", nargs="?", default="office", metavar="WORLD", help="(default: %(default)s)")


def _add_robots(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "worlds", nargs="*", default=["office"], metavar="WORLD", help="worlds to drive in (default: office)"
    )
    _add_rows(parser, "--rows", (*CHAINS, FORMATIONS))
    parser.add_argument(
        "--tours",
        type=whole(1, 30, "tours"),
        metavar="N",
        help="drive only the first N tours; formations from the first N starts",
    )
    parser.add_argument(
        "--in-process", action="store_true", help="run each team in one process, several at once: the same figures"
    )


def _robots(args: argparse.Namespace) -> Shown:
    chains = [row for row in args.rows if row != FORMATIONS]
    found: list[Any] = []
    with _live() as say:

        def show(row: str, done: int, total: int) -> None:
            say(f"{row}: run {done} of {total}")

        for world in map(find_world, args.worlds) if chains else ():
            found += measure_chains(world, chains, args.tours, in_process=args.in_process, progress=show)
        if FORMATIONS in args.rows:
            found += measure_formations(args.tours, in_process=args.in_process, progress=show)
    return found, format_robots(found)


def _add_faults(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("team", nargs="?", default="chain", metavar="TEAM", help="(default: %(default)s)")
    parser.add_argument("--seed", type=whole(0, 2**63 - 1, "a seed"), default=1, metavar="N", help="of the plan")
    parser.add_argument(
        "--seconds", type=number(10.0, 1e6, "seconds"), default=600.0, metavar="S", help="of simulated time"
    )
    parser.add_argument("--speed", metavar="X", help="not in lock-step but at this speed, or max")


def _faults(args: argparse.Namespace) -> Shown:
    with _live() as say:
        found = measure_faults(args.team, args.seed, args.seconds, args.speed, say)
    return found, msgspec.json.encode(found).decode()


def _add_view(parser: argparse.ArgumentParser) -> None:
    _add_world(parser)
    parser.add_argument(
        "--seconds", type=number(2.0, 600.0, "seconds"), default=10.0, metavar="S", help="of each measurement"
    )
    parser.add_argument("--pairs", type=whole(1, 100, "pairs"), default=10, metavar="N", help="pairs of runs")
    _add_rows(parser, "--parts", PARTS)


def _view(args: argparse.Namespace) -> Shown:
    with _live() as say:
        found = measure_view(find_world(args.world), args.seconds, args.pairs, tuple(args.parts), say)
    return found, format_view(found)


def _add_navigation(parser: argparse.ArgumentParser) -> None:
    _add_world(parser)
    _add_rows(parser, "--rows", (*NAVIGATION, *TEAM_ROWS))
    parser.add_argument(
        "--tours",
        type=whole(1, 1000, "tours"),
        default=30,
        metavar="N",
        help="number of tours; two thirds as many random starts (default: %(default)s)",
    )
    parser.add_argument(
        "--scenarios", type=Path, metavar="DIR", help="folder of MovingAI's .map and .scen files: check all lengths"
    )


def _navigation(args: argparse.Namespace) -> Shown:
    with _live() as say:
        rows = measure_navigation(
            find_world(args.world), args.rows, args.tours, args.scenarios,
            lambda row, done, total: say(f"{row}: {done} of {total}"),
        )  # fmt: skip
        found = list(rows)
    return found, format_navigation(found)


def _add_size(parser: argparse.ArgumentParser) -> None:
    _add_world(parser)
    parser.add_argument("--robots", type=whole(1, 1000, "robots"), default=4, metavar="N")
    parser.add_argument("--beams", type=whole(2, 100_000, "beams"), default=1081, metavar="N")


def _add_floor(parser: argparse.ArgumentParser) -> None:
    _add_size(parser)
    parser.add_argument("--seconds", type=number(1.0, 600.0, "simulated seconds"), default=20.0, metavar="S")


def _floor(args: argparse.Namespace) -> Shown:
    found = measure_floor_of(find_world(args.world), args.robots, args.beams, args.seconds)
    return found, format_floor(found)


def _hops(args: argparse.Namespace) -> Shown:
    found = measure_hops_in(find_world(args.world), args.robots, args.beams)
    return found, format_hops(found)


def _add_steps(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--seconds", type=number(1.0, 600.0, "simulated seconds"), default=20.0, metavar="S", help="of each scene"
    )


def _steps(args: argparse.Namespace) -> Shown:
    found = list(measure_steps(args.seconds))
    return found, format_steps(found)


def _add_freezes(parser: argparse.ArgumentParser) -> None:
    _add_rows(parser, "--processes", PROCESSES)
    _add_rows(parser, "--modes", tuple(MODES))
    parser.add_argument("--seconds", nargs="+", type=number(1.0, 600.0, "seconds"), default=SECONDS, metavar="S")
    parser.add_argument("--seeds", nargs="+", type=whole(0, 2**31, "a seed"), default=(1, 2), metavar="N")


def _freezes(args: argparse.Namespace) -> Shown:
    with _live() as say:
        found = list(measure_freezes(args.processes, args.seconds, args.modes, args.seeds, say))
    return found, format_freezes(found)


def _add_recovery(parser: argparse.ArgumentParser) -> None:
    _add_rows(parser, "--faults", FAULTS)
    parser.add_argument("--lockstep", action="store_true", help="a team in lock-step, as fast as the host's clock")


def _recovery(args: argparse.Namespace) -> Shown:
    with _live() as say:
        found = measure_recovery(args.faults, ["--lockstep", "--speed", "1"] if args.lockstep else [], say)
    return found, format_recovery(found)


def _lines(args: argparse.Namespace) -> Shown:
    found = lines.measure_study(args)
    return found, lines.format_study(found)


def _add_secure(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--seconds", type=number(3.0, 600.0, "simulated seconds"), default=60.0, metavar="S", help="of each run"
    )
    parser.add_argument("--rounds", type=whole(1, 100, "rounds"), default=4, metavar="N")


def _secure(args: argparse.Namespace) -> Shown:
    with _live() as say:
        found = measure_secure(args.seconds, args.rounds, say)
    return found, format_secure(found)


STUDIES: dict[str, tuple[str, Callable[[argparse.ArgumentParser], None], Callable[[argparse.Namespace], Shown]]] = {
    "lines": ("lines from many seeds: how well they hold and drive", lines.add_study, _lines),
    "robots": ("how well robots follow each other, and hold formations", _add_robots, _robots),
    "nav": ("planning, costmaps, localisation, and robots that navigate", _add_navigation, _navigation),
    "faults": ("a team under random faults: recovery, violations, leaks, memory", _add_faults, _faults),
    "view": ("age of frames, memory, cost in lock-step, drawing", _add_view, _view),
    "floor": ("a team in lock-step beside bare Zenoh with the same messages", _add_floor, _floor),
    "hops": ("the steps of a tick, each alone", _add_size, _hops),
    "freezes": ("a line whose processes are frozen, each in turn", _add_freezes, _freezes),
    "recovery": ("a team whose processes are killed, each in turn", _add_recovery, _recovery),
    "secure": ("certificates: their cost, and how soon a revoked robot is out", _add_secure, _secure),
    "steps": ("a robot's step: velocity mux, behaviour and safety layer, scene by scene", _add_steps, _steps),
}
"""By name: what it measures, its options, and what runs it."""
