"""`zteam-router`: the one Zenoh router of a host. Other commands start it on demand; routers of hosts are linked."""

import argparse
from functools import partial

from zteam.bus.options import DEFAULT_ENDPOINT, DEFAULT_TLS_ENDPOINT, RouterOptions, TlsFiles, default_endpoint
from zteam.cli.options import Parser, add_lease_option, add_log_options, run_tool
from zteam.node.router import run_router


def build_parser() -> Parser:
    """The command line."""
    parser = Parser(prog="zteam-router", description=__doc__)
    parser.add_argument(
        "--listen",
        metavar="ENDPOINT",
        action="append",
        help=f"listen here; may be repeated (default: {DEFAULT_ENDPOINT}; with $ZTEAM_TLS_CA {DEFAULT_TLS_ENDPOINT})",
    )
    parser.add_argument(
        "--connect",
        metavar="ENDPOINT",
        action="append",
        default=[],
        help="link this router to the one there, such as another host's, as soon as it is there; may be repeated",
    )
    parser.add_argument(
        "--config", metavar="FILE.json5", help="read Zenoh settings from this file first, and again when it changes"
    )
    parser.add_argument("--announce", action="store_true", help="print the endpoint on stdout once it listens")
    add_lease_option(parser)
    add_log_options(parser)
    return parser


def _route(args: argparse.Namespace) -> int:
    tls = TlsFiles.from_environment()
    listen = tuple(args.listen or [default_endpoint(tls)])
    options = RouterOptions(listen, tuple(args.connect), args.config, args.lease, tls)
    return run_router(options, announce=args.announce)


main = partial(run_tool, build_parser, _route, name="router")
