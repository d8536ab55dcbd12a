"""`zteam view`: see the team in a browser, and drive it with the mouse (docs/view.md)."""

import argparse
from collections.abc import Callable
from functools import partial
from pathlib import Path

from zteam import names
from zteam.cli.arguments import whole
from zteam.cli.options import Parser, add_bus_options, run_process
from zteam.node.process_options import DEFAULT_FOXGLOVE_PORT, DEFAULT_VIEW_PORT, ViewOptions


def build_parser() -> Parser:
    """The command line."""
    given = ViewOptions.from_environment()
    parser = Parser(prog="zteam view", description=__doc__)
    parser.add_argument(
        "--host", default=given.host, help="listen at this address (default: %(default)s; $ZTEAM_VIEW_HOST)"
    )
    parser.add_argument(
        "--port",
        type=whole(0, 65535, "a port"),
        default=DEFAULT_VIEW_PORT,
        help="listen at this port (default: %(default)s)",
    )
    parser.add_argument(
        "--public-url",
        default=given.public_url,
        metavar="URL",
        help="print this address: where browsers find the page behind a published port or a proxy ($ZTEAM_VIEW_URL)",
    )
    parser.add_argument("--no-browser", action="store_true", help="print the address only")
    parser.add_argument("--layout", type=Path, metavar="FILE", help="begin with this layout, which the page has saved")
    parser.add_argument(
        "--token",
        default=given.token,
        help="what a page needs to command (default: a new one; $ZTEAM_VIEW_TOKEN)",
    )
    parser.add_argument("--foxglove", action="store_true", help="show the team to Foxglove and Lichtblick too")
    parser.add_argument(
        "--foxglove-port",
        type=whole(0, 65535, "a port"),
        default=DEFAULT_FOXGLOVE_PORT,
        help="where they find it (default: %(default)s)",
    )
    parser.add_argument(
        "--foxglove-layout", type=Path, metavar="FILE", help="write a layout of this team's topics for them, and end"
    )
    # What a test waits for.
    parser.add_argument("--name", default="", help=argparse.SUPPRESS)
    add_bus_options(parser)
    return parser


def _read(args: argparse.Namespace) -> tuple[str, Callable[[], ViewOptions]]:
    foxglove_port = args.foxglove_port if args.foxglove else None
    options = ViewOptions(
        args.host,
        args.port,
        args.token,
        not args.no_browser,
        args.layout,
        foxglove_port,
        args.foxglove_layout,
        args.name,
        args.public_url,
    )
    return names.VIEW, lambda: options


main = partial(run_process, build_parser, _read, needs_output=False)
