"""`zteam-router`: the one Zenoh router of a machine. Other commands start it on demand."""

import argparse
from collections.abc import Sequence

from zteam.bus.options import DEFAULT_ENDPOINT
from zteam.cli.arguments import number
from zteam.cli.interrupts import leave
from zteam.cli.options import Parser, add_lease_option, add_log_options, run
from zteam.nodes.router import run_router
from zteam.numbers import MAX_SECONDS


def build_parser() -> argparse.ArgumentParser:
    """The command line."""
    parser = Parser(prog="zteam-router", description=__doc__)
    parser.add_argument(
        "--listen", metavar="ENDPOINT", default=DEFAULT_ENDPOINT, help="listen here (default: %(default)s)"
    )
    parser.add_argument("--config", metavar="FILE.json5", help="read Zenoh settings from this file first")
    parser.add_argument("--announce", action="store_true", help="print the endpoint on stdout once it listens")
    parser.add_argument(
        "--detached", type=number(0.0, MAX_SECONDS, "seconds"), metavar="SECONDS", help=argparse.SUPPRESS
    )
    add_lease_option(parser)
    add_log_options(parser)
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point."""
    args = build_parser().parse_args(argv)
    return run(
        "router",
        args,
        lambda: run_router(
            args.listen, config=args.config, detached=args.detached, announce=args.announce, lease=args.lease
        ),
    )


if __name__ == "__main__":
    leave(main())
