"""`zteam-router`: the one Zenoh router of a host. Other commands start it on demand; routers of hosts are linked."""

import argparse
from functools import partial

from zteam.bus.options import DEFAULT_ENDPOINT, DEFAULT_TLS_ENDPOINT, RouterOptions, TlsFiles, default_endpoint
from zteam.cli.options import Parser, add_lease_option, add_log_options, add_repeated, run_tool
from zteam.node.router import run_router


def build_parser() -> Parser:
    parser = Parser(prog="zteam-router", description=__doc__)
    text = f"listen here (default: {DEFAULT_ENDPOINT}; with $ZTEAM_TLS_CA {DEFAULT_TLS_ENDPOINT})"
    add_repeated(parser, "--listen", "ENDPOINT", text)
    text = "link this router to the one there, such as another host's, as soon as it is there"
    add_repeated(parser, "--connect", "ENDPOINT", text)
    text = "read Zenoh settings from this file first, and again when it changes"
    parser.add_argument("--config", metavar="FILE.json5", help=text)
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
