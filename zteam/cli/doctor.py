"""`zteam doctor`: checks the router, the processes and the data; names the next step for every problem."""

import argparse
import os
import platform
import socket
import sys
from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, version

import msgspec

from zteam import names
from zteam.bus import Bus, BusOptions
from zteam.bus.connection import host_port, port_accepts, read_admin
from zteam.bus.counters import KeyCount
from zteam.bus.presence import ProcessInfo
from zteam.cli.listening import KeySurvey, open_bus, survey
from zteam.cli.node import find_nodes, writer_names
from zteam.cli.options import Parser, add_bus_options, bus_options, run
from zteam.errors import BusError
from zteam.launch import kinds

_PACKAGES = ("zteam", "eclipse-zenoh", "numpy", "msgspec", "numba", "pymunk", "pillow")
_INIT_SYN = bytes.fromhex("1900c109f2")
_INIT_SYN_END = bytes.fromhex("0ac8ff812701")
"""Zenoh's first handshake message, protocol version 9, around 16 bytes of session id: only a Zenoh router answers."""


class Finding(msgspec.Struct):
    """One check."""

    what: str
    good: bool
    text: str
    next_step: str = ""
    """What to do about it; empty for a good finding."""


def build_parser() -> argparse.ArgumentParser:
    """The command line."""
    parser = Parser(prog="zteam doctor", description=__doc__)
    parser.add_argument("--json", action="store_true")
    add_bus_options(parser)
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point."""
    args = build_parser().parse_args(argv)
    return run("zteam doctor", args, lambda: _examine(args))


def _examine(args: argparse.Namespace) -> int:
    options = bus_options(args)
    findings = [_versions(), _numba()]
    router = _router(options)
    findings.append(router)
    if router.good:
        bus = open_bus(msgspec.structs.replace(options, connect=options.endpoint))
        try:
            findings += _team(bus)
        finally:
            bus.close()
    if args.json:
        print(msgspec.json.encode(findings).decode())
    else:
        for finding in findings:
            _print(finding)
    return 0 if all(finding.good for finding in findings) else 1


def _print(finding: Finding) -> None:
    color = sys.stdout.isatty() and "NO_COLOR" not in os.environ
    mark = "ok" if finding.good else "!!"
    if color:
        mark = f"\033[{32 if finding.good else 31}m{mark}\033[0m"
    print(f"{mark} {finding.what:10} {finding.text}")
    if finding.next_step:
        print(f"   {'':10} -> {finding.next_step}")


def _versions() -> Finding:
    found = [f"python {platform.python_version()}"]
    for package in _PACKAGES:
        try:
            found.append(f"{package} {version(package)}")
        except PackageNotFoundError:
            found.append(f"{package} missing")
    return Finding("versions", True, ", ".join(found))


def _numba() -> Finding:
    from importlib.util import find_spec

    if find_spec("numba") is None:
        return Finding("lasers", False, "numba is missing: scans are computed slowly", "pip install numba")
    return Finding("lasers", True, "compiled by numba")


def speaks_zenoh(endpoint: str) -> bool | None:
    """Whether a Zenoh router answers at a TCP endpoint; None for an endpoint that is not TCP."""
    address = host_port(endpoint)
    if address is None or not endpoint.startswith("tcp/"):
        return None
    try:
        with socket.create_connection(address, timeout=1.0) as link:
            link.settimeout(1.0)
            link.sendall(_INIT_SYN + os.urandom(16) + _INIT_SYN_END)
            answer = link.recv(64)
    except OSError:
        return False
    # Behind two bytes of length: InitAck is message 1 with the A flag.
    return len(answer) > 2 and answer[2] & 0x1F == 1 and bool(answer[2] & 0x20)


def _router(options: BusOptions) -> Finding:
    endpoint = options.endpoint
    if not port_accepts(endpoint):
        return Finding("router", False, f"nothing listens at {endpoint}", kinds.ROUTER_KIND.hint)
    if speaks_zenoh(endpoint) is False:
        step = "end that program, or run 'zteam-router --listen tcp/127.0.0.1:PORT' and use --connect"
        return Finding("router", False, f"what listens at {endpoint} does not speak Zenoh", step)
    admin = read_admin(endpoint)
    if admin is None:
        step = "is it frozen, or does it need TLS (--config)?"
        return Finding("router", False, f"the router at {endpoint} does not answer", step)
    data = admin.metadata
    router = "zteam-router" if data and data.name else "a Zenoh router that is not zteam's"
    pid = f", process {data.pid}" if data and data.pid else ""
    return Finding("router", True, f"{router} at {endpoint}{pid}, Zenoh {admin.version or '?'}")


def _team(bus: Bus) -> list[Finding]:
    nodes = find_nodes(bus)
    keys = survey(bus, "**")
    try:
        counts = bus.query(names.stats_key("*"), dict[str, KeyCount])
    except BusError:
        counts = []
    return [*check_processes(nodes), *_data(nodes, keys), *_writers(nodes, keys), _drops(counts)]


def check_processes(nodes: list[ProcessInfo]) -> list[Finding]:
    """One finding per kind of process on the bus, and one for every process that does not answer."""
    alive = {node.name for node in nodes}
    robots = sum(names.robot_id_of(name) is not None for name in alive)
    findings = [_of_kind(kind, alive, robots) for kind in kinds.KINDS if kind.on_bus]
    findings = [finding for finding in findings if finding.good or finding.next_step]
    for node in nodes:
        if not node.pid:
            text = f"{node.name} is alive but does not answer"
            findings.append(Finding("process", False, text, "it may be frozen: look at it, or end it"))
    return findings


def _of_kind(kind: kinds.Kind, alive: set[str], robots: int) -> Finding:
    """Whether processes of a kind are alive; bad without a next step where the team can work without them."""
    per_robot = kind.robot_id_of
    found = sorted(filter(kind.includes, alive), key=per_robot and (lambda name: per_robot(name) or 0))
    if found:
        return Finding(kind.title, True, "alive" if per_robot is None else ", ".join(found))
    text = f"no process {kind.name}" if per_robot is None else "none"
    return Finding(kind.title, False, text, kind.hint.format(robots=max(1, robots)))


def _data(nodes: list[ProcessInfo], keys: list[KeySurvey]) -> list[Finding]:
    heard = {entry.key for entry in keys}
    text = f"{len(heard)} keys carry data" if heard else "no key carries data"
    findings = [Finding("data", bool(heard), text, "" if heard else "start a simulator or a robot")]
    for node in nodes:
        robot_id = names.robot_id_of(node.name)
        if robot_id is not None and names.scan_key(robot_id, 0) not in heard:
            step = f"has the world a robot {robot_id} with a laser? see 'zteam topic list'"
            findings.append(Finding("data", False, f"{node.name} gets no scan", step))
    return findings


def _writers(nodes: list[ProcessInfo], keys: list[KeySurvey]) -> list[Finding]:
    """Robots that get commands from more than one process."""
    findings = []
    for entry in keys:
        target = names.split_robot_key(entry.key)
        if target is not None and target[1] == names.CMD_VEL and len(entry.sources) > 1:
            writers = ", ".join(writer_names(nodes, entry.sources))
            text = f"{entry.key} has {len(entry.sources)} writers: {writers}"
            findings.append(Finding("commands", False, text, "end all but one: their commands take turns"))
    return findings


def _drops(counts: list[tuple[str, dict[str, KeyCount]]]) -> Finding:
    dropped = {key: count.dropped for _, per_key in counts for key, count in sorted(per_key.items()) if count.dropped}
    if not dropped:
        return Finding("refusals", True, "no message was refused")
    shown = ", ".join(f"{key} ({count})" for key, count in list(dropped.items())[:5])
    return Finding("refusals", False, f"refused messages on {shown}", "'zteam topic info KEY' names the writers")


if __name__ == "__main__":
    sys.exit(main())
