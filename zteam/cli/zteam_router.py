"""`zteam-router`: the one Zenoh router of a machine. Nobody has to start it; other commands do so on demand."""

import argparse
import sys
from collections.abc import Sequence

from zteam.bus.options import DEFAULT_ENDPOINT
from zteam.cli.options import Parser, number, run
from zteam.nodes.router.node import run_router
from zteam.numbers import MAX_SECONDS
from zteam.runtime.logs import LEVELS


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point."""
    parser = Parser(prog="zteam-router", description=__doc__)
    parser.add_argument("--listen", metavar="ENDPOINT", default=DEFAULT_ENDPOINT, help="(default: %(default)s)")
    parser.add_argument("--config", metavar="FILE.json5", help="Zenoh configuration to start from")
    parser.add_argument("--announce", action="store_true", help="print the endpoint on stdout once it listens")
    parser.add_argument(
        "--detached", type=number(0.0, MAX_SECONDS, "seconds"), metavar="SECONDS", help=argparse.SUPPRESS
    )
    parser.add_argument("--log-level", choices=LEVELS, default="info")
    parser.add_argument("--log-format", choices=("text", "json"), default="text")
    args = parser.parse_args(argv)
    return run(
        "router",
        args,
        lambda: run_router(args.listen, config=args.config, detached=args.detached, announce=args.announce),
    )


if __name__ == "__main__":
    sys.exit(main())
