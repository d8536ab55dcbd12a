"""`zteam node list`: list the processes that are alive, their hosts and their uptimes."""

import argparse
from collections.abc import Sequence
from contextlib import closing
from functools import partial

from zteam import names
from zteam.bus import Bus
from zteam.bus.presence import ProcessInfo, find_processes, holder_text, names_of_sessions
from zteam.cli.listening import Waiter, open_bus
from zteam.cli.options import Parser, add_bus_options, bus_options, run_tool
from zteam.cli.output import print_block, print_json
from zteam.cli.progress_text import duration_text
from zteam.cli.tables import format_table
from zteam.node.tokens import TokenSet

_SETTLE = 0.3
"""Seconds to wait for all tokens: a session that was just opened may have none yet."""


def find_nodes(bus: Bus) -> list[ProcessInfo]:
    """Every process that answers or has a presence token; one that does not answer has pid 0."""
    tokens = TokenSet()

    def take(key: str, alive: bool) -> None:
        token = names.split_token_key(key)
        # `zteam tf static` holds a token for the aggregator alone.
        if token and token[0] != names.STATIC_CALLER:
            tokens.take(*token, alive)

    watch = bus.watch_tokens([names.tokens_key()], take)
    Waiter().wait(lambda: False, _SETTLE, "")
    for handle in watch:
        handle.close()
    # By name too: one process may hold several, as a navigation of several robots does.
    infos = {(info.name, info.instance): info for info in find_processes(bus)}
    held = [(name, instance) for name in tokens for instance in tokens.instances(name)]
    silent = [ProcessInfo(name, "does not answer", 0, 0, i) for name, i in held if (name, i) not in infos]
    # On a crowded machine an answer is there before its process's token.
    return sorted([*infos.values(), *silent], key=lambda info: (info.name, info.instance))


def writer_names(nodes: Sequence[ProcessInfo], sessions: Sequence[str], key: str = "") -> list[str]:
    """Names of the processes that own these sessions, as users of `key`; one without a name is shown by its id."""
    known = names_of_sessions(nodes, key)
    return [holder_text(known.get(session), session) if session else "unknown (no time stamp)" for session in sessions]


def build_parser() -> Parser:
    """The command line."""
    parser = Parser(prog="zteam node", description=__doc__)
    verbs = parser.add_subparsers(dest="verb", required=True, metavar="list")
    listing = verbs.add_parser("list", help="list the processes that are alive")
    listing.add_argument("--json", action="store_true", help="print JSON")
    add_bus_options(listing)
    return parser


def _list(args: argparse.Namespace) -> int:
    with closing(open_bus(bus_options(args))) as bus:
        found = find_nodes(bus)
    if args.json:
        print_json(found)
        return 0
    header = ("process", "host", "pid", "up", "zteam")
    print_block(
        format_table(header, list(map(_cells, found))) if found else "no processes (start a team with 'zteam up')"
    )
    return 0


def _cells(info: ProcessInfo) -> tuple[str, ...]:
    known = (str(info.pid), duration_text(max(0.0, info.age)), info.version) if info.pid else ("-", "-", "-")
    return info.name, info.host, *known


main = partial(run_tool, build_parser, _list)
