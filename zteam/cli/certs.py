"""`zteam certs`: a team's certificates, one a process: make, list, renew and revoke them."""

import argparse
import os
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

import msgspec

from zteam.bus.options import check_namespace
from zteam.cli.options import Parser, add_log_options, add_option, add_repeated, run_tool
from zteam.cli.tables import format_table, terminal_width
from zteam.config.resources import find_team
from zteam.errors import UsageError, did_you_mean
from zteam.node.kinds import ROUTER
from zteam.node.output import print_block, print_json, print_line
from zteam.team.security.access import explain, rights_of
from zteam.team.security.certificates import (
    ACCESS,
    CA,
    DAYS,
    FOLDER,
    MAX_DAYS,
    Authority,
    Issued,
    load_certificate,
    open_authority,
    read_index,
)


class Row(msgspec.Struct):
    """A certificate, as `list --json` tells it; the authority's own has serial 0."""

    name: str
    serial: int
    expires: str
    """ISO 8601."""
    expires_in: str
    state: str
    hosts: tuple[str, ...] = ()


def build_parser() -> Parser:
    parser = Parser(prog="zteam certs", description=__doc__, epilog="docs/security.md tells the whole story.")

    def verb(name: str, act: Callable[[argparse.Namespace], None], text: str) -> Parser:
        sub = parser.add_verb(name, act, text)
        sub.add_argument("--folder", type=Path, default=Path(FOLDER), help="of the certificates (default: %(default)s)")
        add_log_options(sub)
        return sub

    text = "make the authority and a certificate for each process of a team; again: take another team"
    init = verb("init", _init, text)
    init.add_argument("team", nargs="?", default="line", metavar="TEAM", help="a team file (default: %(default)s)")
    init.takes_assignments = True
    init.add_argument("arguments", nargs="*", metavar="NAME=VALUE", help="arguments of the team file")
    init.add_argument("--namespace", default=os.environ.get("ZTEAM_NAMESPACE"), help="of the team ($ZTEAM_NAMESPACE)")
    issue = verb("issue", _issue, "make a certificate where a name has none that is valid")
    renew = verb("renew", _renew, "make the next certificate of a name; the earlier one stays valid")
    for sub in (init, issue, renew):
        add_repeated(sub, "--host", "NAME_OR_IP", "where the router is reached, besides this machine")
        add_option(sub, "--days", typed=(1, MAX_DAYS, "days"), default=DAYS, help="valid for so long")
    revoke = verb("revoke", _revoke, "take back all certificates of a name; NAME.SERIAL takes back this one")
    for sub in (issue, renew, revoke):
        sub.add_argument("names", nargs="+", metavar="NAME", help="a process, such as robot_1, or a tool's: operator")
    verb("list", _list, "list all certificates").add_argument("--json", action="store_true", help="print JSON")
    verb("explain", _explain, "show what a certificate may do").add_argument("name", metavar="NAME")
    return parser


def _init(args: argparse.Namespace) -> None:
    from zteam.team.file.reading import read_team_file
    from zteam.team.file.sources import parse_arguments

    rights = rights_of(read_team_file(find_team(args.team), parse_arguments(args.arguments)).team)
    with open_authority(args.folder, make=True) as authority:
        if not authority.has_key:
            print_line(f"{args.folder / CA}: a new authority, valid until {authority.make():%Y-%m-%d}")
        authority.take_team(args.team, rights, check_namespace(args.namespace or "", "--namespace"))
        _issue_missing(authority, [ROUTER], args.host, args.days)
        _issue_missing(authority, [name for name in rights if name != ROUTER], (), args.days)


def _check_hosts(args: argparse.Namespace) -> None:
    if args.host and args.names != [ROUTER]:
        raise UsageError(f"--host {args.host[0]}: only the certificate {ROUTER} has hosts: name it alone")


def _issue(args: argparse.Namespace) -> None:
    _check_hosts(args)
    with open_authority(args.folder) as authority:
        revoked = [name for name in args.names if (last := authority.index.last(name)) and last.revoked]
        _issue_now(authority, revoked, args.host, args.days)
        _issue_missing(authority, [name for name in args.names if name not in revoked], args.host, args.days)


def _issue_missing(authority: Authority, names: Sequence[str], hosts: Sequence[str], days: int) -> None:
    missing = []
    for name in names:
        last = authority.index.last(name)
        if last is None or last.state == "expired" or not (last.revoked or authority.is_complete(name)):
            missing.append(name)
        elif last.revoked:
            print_line(f"{name} is revoked: 'zteam certs issue {name}' makes the next certificate")
        elif lacking := [host for host in hosts if host not in last.hosts]:
            words = " ".join(f"--host {host}" for host in (*last.hosts, *lacking))
            text = f"{name}.{last.serial} is valid, but not for {lacking[0]}: 'zteam certs renew {name} {words}'"
            raise UsageError(text)
        else:
            print_line(f"{name}.{last.serial} is valid for {last.left} still")
    _issue_now(authority, missing, hosts, days)


def _issue_now(authority: Authority, names: Sequence[str], hosts: Sequence[str], days: int) -> None:
    for name, made in zip(names, authority.issue(names, hosts, days), strict=True):
        print_line(f"{authority.folder / name}.pem, .key: {name}.{made.serial}, valid until {made.expires:%Y-%m-%d}")


def _renew(args: argparse.Namespace) -> None:
    _check_hosts(args)
    with open_authority(args.folder) as authority:
        for name in args.names:
            last = authority.index.last(name)
            _issue_now(authority, [name], args.host or (last.hosts if last else ()), args.days)
            if last is not None and last.state in ("valid", "expires_soon"):
                text = f"{name}.{last.serial} stays valid until {last.expires:%Y-%m-%d}, or until"
                print_line(f"{text} 'zteam certs revoke {name}.{last.serial}'")


def _revoke(args: argparse.Namespace) -> None:
    with open_authority(args.folder) as authority:
        for word in args.names:
            name, dot, number = word.rpartition(".")
            # The name of a user's node may have a dot too.
            one = bool(dot) and number.isdecimal() and word not in authority.index.certificates
            taken = authority.revoke(name, int(number)) if one else authority.revoke(word)
            listed = ", ".join(f"{name if one else word}.{serial}" for serial in taken)
            text = f"revoked: {listed}; a router has it out 2 s after it has {ACCESS}"
            print_line(text if taken else f"{word} was revoked")


def _list(args: argparse.Namespace) -> None:
    index = read_index(args.folder)
    own = Issued(0, load_certificate(args.folder / CA).not_valid_after_utc)
    listed = [("authority", [own]), *sorted(index.certificates.items())]
    rows = [Row(name, c.serial, c.expires.isoformat(), c.left, c.state, c.hosts) for name, own in listed for c in own]
    cells = [(row.name, str(row.serial or "-"), row.expires_in, row.state.replace("_", " ")) for row in rows]
    print_json(rows) if args.json else print_block(format_table(("name", "serial", "expires in", "state"), cells))


def _explain(args: argparse.Namespace) -> None:
    rights = read_index(args.folder).rights
    if args.name not in rights:
        raise UsageError(f"{args.name}: no such name{did_you_mean(args.name, rights)}; known: {', '.join(rights)}")
    last = read_index(args.folder).last(args.name)
    state = "no certificate yet" if last is None else f"{args.name}.{last.serial}, {last.state.replace('_', ' ')}"
    print_line(f"{args.name}: {state}")
    print_block(format_table(("may", "key"), explain(rights[args.name]), width=terminal_width()))


main = partial(run_tool, build_parser, None)
