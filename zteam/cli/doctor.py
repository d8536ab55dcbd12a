"""`zteam doctor`: checks the router, the processes and the data; names cause and next step for every problem of now."""

import argparse
import platform
import sys
import textwrap
import threading
from collections import defaultdict
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TypeVar

import msgspec

from zteam import names
from zteam.bus import Bus, BusOptions, connect
from zteam.bus.connection import why_refused
from zteam.bus.options import port_accepts
from zteam.bus.presence import ProcessInfo
from zteam.bus.receiving import KeyCount
from zteam.bus.router import find_local_routers, read_admin
from zteam.bus.topics import type_of_key
from zteam.bus.transport import RawSample
from zteam.cli.listening import SURVEY, Waiter, open_bus
from zteam.cli.live_line import has_color
from zteam.cli.node import find_nodes, writer_names
from zteam.cli.options import Parser, add_bus_options, bus_options, run_tool
from zteam.cli.tables import terminal_width
from zteam.cli.tf_displays import ask_frames
from zteam.diagnosis.checks import check_team
from zteam.diagnosis.facts import Facts, Fault, Finding, Level, ok, problem
from zteam.diagnosis.maps import check_map_file
from zteam.errors import BusError, DecodeError
from zteam.launch import kinds
from zteam.messages import Message, OccupancyGrid, RobotStatus, TeamStatus, decode, type_of_encoding
from zteam.messages.message import NO_INT8
from zteam.numbers import counted
from zteam.services.simulator import MapInfo, find_status

_PACKAGES = ("zteam", "eclipse-zenoh", "numpy", "msgspec", "pymunk", "pillow")


def check_versions() -> Finding:
    """The versions of the packages that zteam needs."""
    found = [f"python {platform.python_version()}"]
    for package in _PACKAGES:
        try:
            found.append(f"{package} {version(package)}")
        except PackageNotFoundError:
            found.append(f"{package} missing")
    return ok("versions", ", ".join(found))


def check_router(options: BusOptions) -> Finding:
    """Whether a Zenoh router answers."""
    endpoint = options.endpoint
    if not port_accepts(endpoint):
        return problem("router", f"nothing listens at {endpoint}", kinds.ROUTER_KIND.hint)
    admin = read_admin(options)
    if admin is None:
        return problem("router", *why_refused(endpoint))
    data = admin.metadata
    router = "zteam-router" if data and data.name else "a Zenoh router that is not zteam's"
    pid = f", process {data.pid}" if data and data.pid else ""
    return ok("router", f"{router} at {endpoint}{pid}, Zenoh {admin.version.partition('-')[0] or '?'}")


M = TypeVar("M", bound=Message)

LONGER = 3.0
"""Host seconds for which the status of a robot that has not been heard is waited for: it comes once a second."""
_SETTLE = 0.3
"""Host seconds to wait for the tokens of other namespaces."""
_MAX_ROUTERS = 32
"""Other routers that are asked."""


def collect_facts(bus: Bus, options: BusOptions) -> Facts:
    """Everything that the checks of a team need."""
    before = find_status(bus)
    nodes = find_nodes(bus)
    heard = _listen(bus, nodes)
    after = find_status(bus)
    admin = read_admin(options)
    router_id = admin.zid if admin else ""
    namer = _namer(nodes, router_id)
    frames = ask_frames(bus)
    newest_map = _newest(heard, names.MAP, OccupancyGrid)
    return Facts(
        nodes=nodes,
        writers={key: [namer(session, key) for session in by] for key, by in sorted(heard.items())},
        faults=_faults(heard, namer),
        counts=_counts(bus),
        statuses=_statuses(heard),
        team=_message(_newest(heard, names.TEAM_STATUS, TeamStatus), TeamStatus),
        sim=after,
        holds=before is not None and after is not None and before.tick == after.tick,
        frames=None if frames is None else {child: frame.parent for child, frame in frames.items()},
        map=_without_cells(_message(newest_map, OccupancyGrid)),
        map_writer=namer(newest_map.source, names.MAP) if newest_map else "",
        namespace=options.namespace or "",
        elsewhere={} if nodes else _elsewhere(options),
        routers={} if _is_complete(nodes) else _at_other_routers(options, router_id),
    )


Heard = dict[str, dict[str, RawSample]]
"""The newest sample of each key and session."""
Namer = Callable[[str, str], str]
"""The name of the process that has a session, as a user of a key."""


def _namer(nodes: list[ProcessInfo], router_id: str) -> Namer:
    def name(session: str, key: str) -> str:
        # The router stamps the samples of sessions that do not.
        if session and session == router_id:
            return "a client without time stamps (plain Zenoh)"
        return writer_names(nodes, [session], key)[0]

    return name


def _listen(bus: Bus, nodes: list[ProcessInfo]) -> Heard:
    """Listen to all keys, latched ones included, until every robot that answers has told its status."""
    heard: Heard = defaultdict(dict)
    lock, waiter = threading.Lock(), Waiter()
    robots = {names.robot_id_of(node.name) for node in nodes if node.pid} - {None}
    due = {names.robot_key(robot_id, names.STATUS) for robot_id in robots if robot_id is not None}

    def take(sample: RawSample) -> None:
        with lock:
            heard[sample.key][sample.source] = sample
        waiter.notify()

    subscription = bus.subscribe_raw("**", take, latched=True)
    waiter.wait(lambda: False, SURVEY, "")
    waiter.wait(lambda: due <= heard.keys(), LONGER, "")
    subscription.close()
    with lock:
        return {key: dict(by) for key, by in heard.items()}


def _counts(bus: Bus) -> dict[str, dict[str, KeyCount]]:
    try:
        answers = bus.query(names.stats_key("*"), dict[str, KeyCount])
    except BusError:
        return {}
    return {key.removesuffix("/stats"): counts for key, counts in answers}


def _faults(heard: Heard, namer: Namer) -> list[Fault]:
    found = []
    for key, by in sorted(heard.items()):
        due = type_of_key(key)
        for source, sample in by.items():
            reason = _fault_of(sample, due) if due is not None else ""
            if reason:
                found.append(Fault(key, namer(source, key), reason))
    return found


def _fault_of(sample: RawSample, due: type[Message]) -> str:
    """What is wrong with a sample of a key with messages of type `due`; empty if nothing is."""
    given = type_of_encoding(sample.encoding)
    if given is not None and given is not due:
        return f"{given.ros_type}, {due.ros_type} is due"
    try:
        decode(due, sample.payload)
    except DecodeError as error:
        return f"bytes that are no {due.ros_type}: {error}"
    return ""


def _statuses(heard: Heard) -> dict[int, RobotStatus]:
    found = {}
    for key in heard:
        target = names.split_robot_key(key)
        if target is not None and target[1] == names.STATUS:
            status = _message(_newest(heard, key, RobotStatus), RobotStatus)
            if status is not None:
                found[target[0]] = status
    return found


def _newest(heard: Heard, key: str, kind: type[Message]) -> RawSample | None:
    """The newest sample of a key that decodes."""
    samples = sorted(heard.get(key, {}).values(), key=lambda sample: -sample.timestamp)
    return next((sample for sample in samples if not _fault_of(sample, kind)), None)


def _message(sample: RawSample | None, kind: type[M]) -> M | None:
    return None if sample is None else decode(kind, sample.payload)


def _without_cells(grid: OccupancyGrid | None) -> OccupancyGrid | None:
    return None if grid is None else msgspec.structs.replace(grid, data=NO_INT8)


def _is_complete(nodes: list[ProcessInfo]) -> bool:
    """Whether a team has every kind of process that it needs."""
    needed = [kind for kind in kinds.KINDS if kind.on_bus and kind.hint]
    return all(any(map(kind.includes, (node.name for node in nodes))) for kind in needed)


def _elsewhere(options: BusOptions) -> dict[str, list[str]]:
    """The processes in other namespaces of the same router."""
    found: dict[str, set[str]] = defaultdict(set)
    for namespace, name in _find_processes(options):
        if namespace != (options.namespace or ""):
            found[namespace].add(name)
    return {namespace: sorted(processes) for namespace, processes in found.items()}


def _at_other_routers(options: BusOptions, router_id: str) -> dict[str, list[str]]:
    """The processes at other routers of this machine, by endpoint."""

    def ask(endpoint: str) -> list[str]:
        there = msgspec.structs.replace(options, connect=endpoint)
        admin = read_admin(there)
        if admin is None or admin.zid == router_id:
            return []
        try:
            places = _find_processes(there)
        except BusError:
            # It has just ended.
            return []
        return sorted({f"{namespace}/{name}" if namespace else name for namespace, name in places})

    endpoints = find_local_routers()[:_MAX_ROUTERS]
    with ThreadPoolExecutor(_MAX_ROUTERS) as pool:
        return {endpoint: found for endpoint, found in zip(endpoints, pool.map(ask, endpoints), strict=True) if found}


def _find_processes(options: BusOptions) -> list[tuple[str, str]]:
    """(namespace, name) of every process at a router."""
    found = []

    def take(key: str, alive: bool) -> None:
        token = names.split_namespaced_token_key(key)
        if alive and token is not None:
            found.append(token[:2])

    everywhere = msgspec.structs.replace(options, connect=options.endpoint, namespace=None)
    with closing(connect(everywhere, patience=1.0)) as bus:
        bus.watch_tokens([names.all_tokens_key()], take)
        Waiter().wait(lambda: False, _SETTLE, "")
    return found


_COLORS: dict[Level, int] = {"ok": 32, "note": 33, "problem": 31}
_NEXT = "-> "


def build_parser() -> Parser:
    """The command line."""
    parser = Parser(prog="zteam doctor", description=__doc__)
    parser.add_argument("--map", metavar="FILE.yaml", help="also compare this map_server file with the running world")
    parser.add_argument("--json", action="store_true", help="print the findings as JSON")
    add_bus_options(parser)
    return parser


def _examine(args: argparse.Namespace) -> int:
    options = bus_options(args)
    map_file = None if args.map is None else _read_map(Path(args.map))
    router = check_router(options)
    findings = [check_versions(), router]
    if router.good:
        with closing(open_bus(msgspec.structs.replace(options, connect=options.endpoint))) as bus:
            findings += _team(bus, options, args.map, map_file)
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
    from zteam.world.images import read_floor_map

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


main = partial(run_tool, build_parser, _examine)
