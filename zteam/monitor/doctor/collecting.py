"""Everything that the checks of a team need, learned from the bus within a moment."""

from collections import defaultdict
from collections.abc import Callable, Container, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing

import msgspec

from zteam import names
from zteam.bus import Bus, BusOptions, connect
from zteam.bus.graph import SURVEY, Graph, Survey, describe_sessions, find_nodes, find_tokens, unpublished
from zteam.bus.presence import ProcessInfo, find_processes
from zteam.bus.receiving import KeyCount
from zteam.bus.router import find_local_routers, find_strangers, read_admin
from zteam.bus.transport import Declaration, RawSample
from zteam.clock import monotonic, pause, to_seconds, wait_until, wall_ns
from zteam.errors import BusError, DecodeError
from zteam.messages import LaserScan, Message, OccupancyGrid, RobotStatus, TeamStatus, decode, type_of_encoding
from zteam.messages.message import zeros
from zteam.messages.std_msgs import ns_from_time
from zteam.messages.topics import has_one_writer, is_measured, is_sensed, type_of_key
from zteam.monitor.doctor.facts import Facts, HostClock, Load, UnusableMessages
from zteam.node import kinds
from zteam.simulator.client import find_status
from zteam.transforms.client import TreeListener, find_frames
from zteam.transforms.lasers import LaserMounts

LONGER = 3.0
"""Host seconds for which the status of a robot that has not been heard is waited for: it comes once a second."""
_MOST_HOSTS = 16
"""Whose clocks are compared: an answer may name any host."""
_MAX_ROUTERS = 32
"""Other routers that are asked."""


def collect_facts(bus: Bus, options: BusOptions) -> Facts:
    """Everything that the checks of a team need."""
    before, begin = find_status(bus), monotonic()
    nodes = find_nodes(bus)
    graph = Graph(bus.declarations(), nodes)
    tree = TreeListener(bus)
    stands = before is None or before.paused or before.finished or (before.lockstep and before.waiting_for)
    survey = _listen(bus, nodes, [] if stands else graph.declarations)
    router_id, strangers = find_strangers(options)
    after, seconds = find_status(bus), monotonic() - begin
    heard = {key: [*samples.values()] for key, samples in sorted(survey.newest.items())}

    def name_of(sample: RawSample) -> str:
        # A router that is not zteam's stamps the samples of sessions that do not.
        if sample.source in ("", router_id):
            return "a client without time stamps (plain Zenoh)"
        return graph.name_sessions([sample.source], sample.key)[0]

    places = describe_sessions(bus, _rivals(heard, graph.declarations))
    faults, newest = _decode(heard, name_of)
    statuses = {key: message for key, (_, message) in newest.items() if isinstance(message, RobotStatus)}
    team, (map_sample, grid) = newest.get(names.TEAM_STATUS), newest.get(names.MAP, (None, None))
    own = {node.instance for node in nodes if node.is_users}
    subscribed = {each.key for each in graph.declarations if not each.publishes and each.session in own}
    frames = find_frames(bus)
    needed = [kind for kind in kinds.KINDS if kind.on_bus and kind.hint]
    is_complete = all(any(kind.includes(node.name) for node in nodes) for kind in needed)
    lasers = {
        key: wrong
        for key, (_, message) in newest.items()
        if isinstance(message, LaserScan) and (target := names.split_robot_key(key))
        if (wrong := LaserMounts(target[0], tree.buffer).level(message).problem)
    }
    return Facts(
        nodes=nodes,
        writers={
            key: [(has_one_writer(key) and places.get(each.source)) or name_of(each) for each in samples]
            for key, samples in heard.items()
        },
        publishers=_publishers(graph, lambda each: each.publishes, places),
        # What all nodes subscribe to is no mistake of a user's own.
        unpublished=unpublished(graph, subscribed - {names.CLOCK, names.TICK}, heard) or {},
        faults=faults,
        dropped=_publishers(graph, lambda each: each.dropped, {}),
        counts={
            key.removesuffix("/stats"): counts for key, counts in bus.find(names.stats_key("*"), dict[str, KeyCount])
        },
        statuses={target[0]: status for key, status in statuses.items() if (target := names.split_robot_key(key))},
        team=team[1] if team and isinstance(team[1], TeamStatus) else None,
        sim=after,
        holds=before is not None and after is not None and before.tick == after.tick,
        frames=None if frames is None else {child: frame.parent for child, frame in frames.items()},
        leads={} if before or after or names.CLOCK in heard else find_leads(newest, survey.times),
        lasers={} if frames is None else lasers,
        map=msgspec.structs.replace(grid, data=zeros("int8")) if isinstance(grid, OccupancyGrid) else None,
        map_writer=name_of(map_sample) if map_sample else "",
        loads=_loads(survey, name_of, {node.instance for node in nodes}),
        tick_rate=max(0, after.tick - before.tick) / seconds if before and after else 0.0,
        strangers=strangers,
        clocks=_compare_clocks(bus, nodes),
        namespace=options.namespace or "",
        elsewhere={} if nodes else _elsewhere(options),
        routers={} if is_complete else at_other_routers(options, router_id),
    )


def find_leads(
    newest: Mapping[str, tuple[RawSample, Message]], arrivals: Mapping[tuple[str, str], Sequence[float]]
) -> dict[str, float]:
    """By how many seconds what bases measure is stamped ahead of this host's clock, by key. `arrivals` are the host
    times of live messages, by session and key."""
    found, wall, now = dict[str, float](), wall_ns(), monotonic()
    for key, (sample, message) in newest.items():
        stamped = [each for each in getattr(message, "transforms", [message]) if hasattr(each, "header")]
        times = arrivals.get((sample.source, key))
        if times and stamped and is_measured(key):
            found[key] = to_seconds(ns_from_time(stamped[-1].header.stamp) - wall) + now - times[-1]
    return found


def _loads(survey: Survey, name_of: Callable[[RawSample], str], known: Container[str]) -> list[Load]:
    """What each session publishes; `known` are those of the team's processes."""
    rates = defaultdict[str, dict[str, float]](dict)
    for (session, key), times in survey.times.items():
        rates[session][key] = len(times) / survey.seconds
    return [
        Load(name_of(survey.newest[key][session]), session in known, own, survey.sizes[session] / survey.seconds)
        for session, own in rates.items()
        for key in [*own][:1]
    ]


def _listen(bus: Bus, nodes: list[ProcessInfo], declarations: Iterable[Declaration]) -> Survey:
    """Listen to all keys until every robot that answers has published its status and all that is measured has come, as
    far as these declarations have it: a slow world takes its time for a tick."""
    robots = {names.robot_id_of(node.name) for node in nodes if node.pid}
    due = {names.robot_key(robot_id, names.STATUS) for robot_id in robots if robot_id is not None}
    due |= {each.key for each in declarations if each.publishes and is_sensed(each.key)}
    with closing(Survey(bus, "**")) as survey:
        pause(SURVEY)
        with survey.changed:
            wait_until(survey.changed, lambda: due <= survey.newest.keys(), LONGER)
    return survey


def _compare_clocks(bus: Bus, nodes: Sequence[ProcessInfo]) -> dict[str, HostClock]:
    """The clocks of all hosts of the team, told by one process of each; of three answers the soonest counts."""
    found: dict[str, HostClock] = {}
    hosts = {node.host: node.name for node in nodes if node.now}
    for host, name in [*hosts.items()][:_MOST_HOSTS]:
        for _ in range(3):
            begin, asked = wall_ns(), monotonic()
            answers = find_processes(bus, name)
            error = 0.5 * (monotonic() - asked)
            times = [info.now for info in answers if info.host == host]
            if times and (host not in found or error < found[host].error):
                found[host] = HostClock(round(to_seconds(times[0] - begin) - error, 4), round(error, 4))
    return found


def _rivals(heard: Mapping[str, Sequence[RawSample]], declarations: Iterable[Declaration]) -> list[str]:
    """The sessions that share a key which has one publisher: what they are called needs their host and process too."""
    users = {key: {each.source for each in samples} for key, samples in heard.items()}
    for each in declarations:
        if each.publishes and not each.key.endswith(f"/{names.CMD_VEL}"):
            users.setdefault(each.key, set()).add(each.session)
    return sorted(set().union(*(found for key, found in users.items() if len(found) > 1 and has_one_writer(key))))


def _publishers(graph: Graph, counts: Callable[[Declaration], bool], places: Mapping[str, str]) -> dict[str, list[str]]:
    """The processes of the declarations that count, by key; in the words of `places` where a session is among them."""
    sessions = defaultdict[str, set[str]](set)
    for each in filter(counts, graph.declarations):
        sessions[each.key].add(each.session)
    return {key: graph.name_sessions(sorted(found), key, places) for key, found in sessions.items()}


def _decode(
    heard: Mapping[str, Sequence[RawSample]], name_of: Callable[[RawSample], str]
) -> tuple[list[UnusableMessages], dict[str, tuple[RawSample, Message]]]:
    """What is wrong with samples of zteam's own keys, and the newest sample of each that is right, with its message."""
    faults, newest = [], dict[str, tuple[RawSample, Message]]()
    for key, samples in heard.items():
        due = type_of_key(key)
        if due is None:
            continue
        for sample in samples:
            given = type_of_encoding(sample.encoding)
            if given is not None and given is not due:
                faults.append(UnusableMessages(key, name_of(sample), f"{given.ros_type}, {due.ros_type} is due"))
                continue
            try:
                message = decode(due, sample.payload)
            except DecodeError as error:
                faults.append(UnusableMessages(key, name_of(sample), f"bytes that are no {due.ros_type}: {error}"))
                continue
            if key not in newest or sample.timestamp > newest[key][0].timestamp:
                newest[key] = sample, message
    return faults, newest


def _elsewhere(options: BusOptions) -> dict[str, list[str]]:
    """The processes in other namespaces of the same router."""
    found = defaultdict[str, list[str]](list)
    for namespace, name in sorted(_processes_at(options)):
        if namespace != (options.namespace or ""):
            found[namespace].append(name)
    return found


def at_other_routers(options: BusOptions, router_id: str) -> dict[str, list[str]]:
    """The processes at other routers of this machine, by endpoint."""

    def ask(endpoint: str) -> list[str]:
        there = msgspec.structs.replace(options, connect=endpoint)
        admin = read_admin(there)
        if admin is None or admin.zid == router_id:
            return []
        try:
            places = _processes_at(there)
        except BusError:
            # It has just ended.
            return []
        return sorted({f"{namespace}/{name}" if namespace else name for namespace, name in places})

    protocol = options.endpoint.partition("/")[0]
    endpoints = [each for each in find_local_routers() if each.startswith(f"{protocol}/")][:_MAX_ROUTERS]
    with ThreadPoolExecutor(_MAX_ROUTERS) as pool:
        return {endpoint: found for endpoint, found in zip(endpoints, pool.map(ask, endpoints), strict=True) if found}


def _processes_at(options: BusOptions) -> set[tuple[str, str]]:
    """(namespace, name) of every process at a router."""
    # A certificate shows its own namespace only.
    namespace = None if options.tls is None else options.namespace
    everywhere = msgspec.structs.replace(options, connect=options.endpoint, namespace=namespace)
    with closing(connect(everywhere, patience=1.0)) as bus:
        return {token[:2] for token in find_tokens(bus, names.tokens_key("**"))}
