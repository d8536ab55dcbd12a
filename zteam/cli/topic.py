"""`zteam topic list | echo | hz | info | pub`: inspect and publish messages on the bus."""

import argparse
import itertools
import statistics
import sys
from collections import deque
from collections.abc import Mapping, Sequence
from contextlib import closing
from functools import partial

import msgspec

from zteam import names
from zteam.bus import Bus, Publisher
from zteam.bus.graph import SURVEY, Graph, KeyRow, find_graph, find_nodes, find_rows, kind_of, near_keys
from zteam.bus.receiving import KeyCount
from zteam.bus.transport import RawSample
from zteam.cli import listening
from zteam.cli.options import MAX_RATE, Parser, add_bus_options, add_clock_option, add_json, add_option, run_tool
from zteam.cli.tables import format_message, format_table, in_ms
from zteam.cli.tool_clock import open_clock, ticker
from zteam.clock import AutoClock, monotonic, pause, to_seconds
from zteam.config.numbers import counted, format_rate
from zteam.config.robot_ids import format_robot_ids
from zteam.errors import DecodeError, UsageError, ZteamError, printable
from zteam.messages import Message, Time, decode, encoding_of, message_type, time_from_ns, to_json, type_of_encoding
from zteam.messages.jsonform import from_words
from zteam.messages.topics import type_of_key
from zteam.node.output import print_block, print_json, print_line

_WINDOW = 100
"""Messages over which a rate is measured."""


def publish(args: argparse.Namespace) -> None:
    """Publish once, a number of times or until Ctrl+C."""
    key, kind = listening.check_key(args.key), message_type(args.type)
    if names.is_wildcard(key):
        raise UsageError(f"{args.key!r} is a wildcard: give one key")
    clock: AutoClock | None = None
    holds_time = False

    def now() -> Time:
        nonlocal holds_time
        holds_time = True
        return Time() if clock is None else time_from_ns(clock.now())

    known = type_of_key(key)
    if known is not None and known.ros_type != kind.ros_type:
        raise UsageError(f"{key} carries {known.ros_type}, not {kind.ros_type}")
    message = from_words(kind, args.values, now)
    times = 1 if args.once else args.times
    with listening.open_bus(args) as bus:
        bus.check_right(key)
        # Before the question: when that is answered, the publisher knows whether it has a subscriber.
        publisher = bus.publisher(key, kind)
        graph = find_graph(bus)
        heard = _heard_encoding(bus, key) if known is None and graph.publishers(key) else ""
        if heard.startswith("application/cdr;") and heard != encoding_of(kind):
            raise UsageError(f"{key} carries {heard.partition(';')[2]}, not {kind.ros_type}")
        if times != 1 or holds_time:
            clock = open_clock(bus, args.clock)
        rate = f"at {args.rate:g} Hz"
        how = "once" if times == 1 else rate if times is None else f"{times} times {rate}"
        print_line(f"publishing {kind.ros_type} on {key} {how} to {_list_subscribers(bus, key, publisher, graph)}")
        if not publisher.has_subscribers:
            hint = "" if graph.publishers(key) else near_keys(key, graph.known_keys())
            _say(f"nothing subscribes to {key}{hint}")
        _warn_of_others(key, graph)

        def send() -> None:
            publisher.put(from_words(kind, args.values, now) if holds_time else message)

        send()
        if clock is None or times == 1:
            return
        wait = ticker(clock, 1.0 / args.rate)
        for _ in itertools.count() if times is None else range(times - 1):
            wait()
            send()


def _list_subscribers(bus: Bus, key: str, publisher: Publisher[Message], graph: Graph) -> str:
    # A session that closes may report a subscriber that it no longer has. One that has just come reports its name now.
    if not publisher.has_subscribers:
        return "no subscriber yet"
    found = graph.subscribers(key) or find_graph(bus).subscribers(key)
    unnamed = "subscribers that tell no name (frozen, or no processes of zteam)"
    return f"{counted(len(found), 'subscriber')}: {', '.join(found)}" if found else unnamed


def _heard_encoding(bus: Bus, key: str) -> str:
    """The encoding of a message on the key, or of its latched one; empty if none comes."""
    waiter = listening.Waiter()
    with closing(bus.subscribe_raw(key, waiter.receive, latched=True)):
        waiter.wait(lambda: bool(waiter.received), SURVEY, "")
    return waiter.received[0].encoding if waiter.received else ""


def _say(text: str) -> None:
    print_line(f"zteam topic pub: {text}", file=sys.stderr)


def _warn_of_others(key: str, graph: Graph) -> None:
    """Warn of other publishers, and of a robot that is not there: the simulator subscribes to the keys of any robot."""
    if others := graph.publishers(key):
        _say(f"{key} is published by {', '.join(others)} too: subscribers get the messages of both; end one of them")
    target, robots = names.split_robot_key(key), sorted(graph.robots())
    if target is not None and robots and target[0] not in robots:
        _say(f"no process publishes anything of {names.robot_name(target[0])}; robots: {format_robot_ids(robots)}")


def build_parser() -> Parser:
    parser = Parser(prog="zteam topic", description=__doc__)
    text = "list the keys with type, rate, and numbers of publishers and subscribers"
    shared = add_json, add_bus_options
    parser.add_verb("list", _list, text, *shared)
    echo = parser.add_verb("echo", _echo, "print messages", *shared)
    rate = parser.add_verb("hz", _hz, "measure the publish rate", *shared)
    text = "print type, rate, size, publishers and subscribers of a key"
    info = parser.add_verb("info", _info, text, *shared)
    pub = parser.add_verb("pub", publish, "publish messages until Ctrl+C", add_bus_options)
    for sub in (echo, rate, info, pub):
        sub.add_argument("key", metavar="KEY", help="key expression, e.g. robot_0/odom")
    echo.add_argument("--once", action="store_true", help="end after one message")
    echo.add_argument("--type", help="decode as this ROS type (default: from the encoding or the key)")
    echo.add_argument("--full", action="store_true", help="print whole arrays")
    listening.add_timeout(echo, "a message")
    rate.add_argument("--once", action="store_true", help="end after the first line")
    listening.add_timeout(rate, "two messages")
    pub.add_argument("type", metavar="TYPE", help="ROS type, e.g. geometry_msgs/msg/Twist")
    text = "fields as JSON or YAML, or as in ROS 1 a list for each field; a stamp may be `now`, a header `auto`"
    pub.add_argument("values", nargs="*", default=[], metavar="'{…}'", help=text)
    bounds = (1e-3, MAX_RATE, "messages a second")
    add_option(pub, "-r", "--rate", typed=bounds, default=1.0, metavar="HZ", help="publish at this rate")
    until = pub.add_mutually_exclusive_group()
    add_option(until, "-t", "--times", typed=(1, 10**12, "messages"), metavar="N", help="end after N messages")
    until.add_argument("-1", "--once", action="store_true", help="end after one message")
    add_clock_option(rate, "wall")
    add_clock_option(pub)
    return parser


def _echo(args: argparse.Namespace) -> None:
    key, given = listening.check_key(args.key), message_type(args.type) if args.type else None
    waiter = listening.Waiter()
    with listening.open_bus(args) as bus:
        bus.subscribe_raw(key, waiter.receive, latched=True)
        listening.wait_for_message(bus, waiter, lambda: bool(waiter.received), args, key)
        while not (_print_sample(waiter.received.popleft(), given, args) and args.once):
            limit = listening.limit_of(args)
            if not waiter.wait(lambda: bool(waiter.received), limit, f"a message on {key}"):
                raise ZteamError(f"no message on {key} within {limit:g} s: {listening.silence(bus, key)}")


def _print_sample(sample: RawSample, given: type[Message] | None, args: argparse.Namespace) -> bool:
    """Print one message; return False if it could not be decoded."""
    kind, sent = given or kind_of(sample), type_of_encoding(sample.encoding)
    if given is not None and sent not in (None, given):
        raise UsageError(f"{sample.key} carries {sent.ros_type}, not {given.ros_type}: leave --type out")
    if kind is None:
        raise UsageError(f"the type of {sample.key} is unknown: give it with --type")
    try:
        message = decode(kind, sample.payload)
    except DecodeError as error:
        print_line(f"{sample.key}: undecodable: {error}", file=sys.stderr)
        return False
    print_json(to_json(message)) if args.json else print_block(format_message(message, args.full) + "\n---")
    return True


def _hz(args: argparse.Namespace) -> None:
    key, waiter = listening.check_key(args.key), listening.Waiter()
    times, received, shown = deque[float](maxlen=_WINDOW), 0, 0
    with listening.open_bus(args) as bus:
        clock = open_clock(bus, args.clock)

        def on_sample(_sample: RawSample) -> None:
            nonlocal received
            now = to_seconds(clock.now()) if clock.simulated else monotonic()
            if times and now < times[-1]:
                # The simulator was reset: drop the stamps from before.
                times.clear()
            times.append(now)
            received += 1
            waiter.notify()

        bus.subscribe_raw(key, on_sample)
        listening.wait_for_message(bus, waiter, lambda: len(times) > 1, args, key, "two messages")

        def has_news() -> bool:
            return len(times) > 1 and received > shown

        while True:
            pause(1.0)
            waiter.wait(has_news, None, f"messages on {key}")
            shown, stamps = received, list(times)
            if len(stamps) < 2:
                continue
            print_block(_format_rate(stamps, clock.simulated, args.json))
            if args.once:
                return


def _format_rate(times: list[float], simulated: bool, as_json: bool) -> str:
    gaps = [b - a for a, b in itertools.pairwise(times)]
    rate = len(gaps) / sum(gaps) if sum(gaps) > 0 else 0.0
    spread = statistics.pstdev(gaps)
    if as_json:
        values = {"rate": rate, "min": min(gaps), "max": max(gaps), "std": spread, "window": len(times)}
        return msgspec.json.encode({**values, "clock": "sim" if simulated else "wall"}).decode()
    return (
        f"average rate: {format_rate(rate)} ({'simulated' if simulated else 'host'} time)\n"
        f"        min: {in_ms(min(gaps))}  max: {in_ms(max(gaps))}  std dev: {in_ms(spread)}  window: {len(times)}"
    )


def _rate(row: KeyRow) -> str:
    if row.latched:
        return "latched"
    # One message in the time of a survey says little about a rate.
    return {0: "-", 1: "~1 Hz"}.get(row.count) or format_rate(row.rate)


def _list(args: argparse.Namespace) -> None:
    with listening.open_bus(args) as bus:
        rows, _ = find_rows(bus, "**")
    cells = [(r.key, r.type or "?", _rate(r), str(len(r.publishers)), str(len(r.subscribers))) for r in rows]
    table = format_table(("key", "type", "rate", "pubs", "subs"), cells, numbers_from=2)
    print_json(rows) if args.json else print_block(table if rows else listening.NO_KEYS)


def _info(args: argparse.Namespace) -> None:
    key = listening.check_key(args.key)
    with listening.open_bus(args) as bus:
        rows, graph = find_rows(bus, key)
        # Those that do not answer have a name too.
        named = Graph((), find_nodes(bus))
        counts = bus.query(names.stats_key("*"), dict[str, KeyCount])
    if not rows:
        raise ZteamError(
            f"nothing publishes {key} or subscribes to it{listening.where_to_look(key, graph.known_keys())}"
        )
    for row in rows:
        stats = {key.removesuffix("/stats"): per_key[row.key] for key, per_key in counts if row.key in per_key}
        heard = named.name_sessions(row.sources, row.key)
        info = {**msgspec.structs.asdict(row), "writers": heard, "receivers": stats}
        print_json(info) if args.json else print_block(_format_info(row, heard, stats))


def _format_info(row: KeyRow, heard: Sequence[str], stats: Mapping[str, KeyCount]) -> str:
    from zteam.monitor.doctor.checks import format_refusals

    received = {name: f"{name}: {count.received} received, {format_refusals(count)}" for name, count in stats.items()}
    silent = [f"{name} (nothing heard of it)" for name in row.publishers if name not in heard]
    subscribers = [received.get(name, name) for name in row.subscribers or received]
    lines = [
        row.key,
        f"  type      {row.type or '?'}",
        f"  rate      {_rate(row)}" + (f", {row.bytes} bytes" if row.count or row.latched else ""),
        *(f"  writer    {name}" for name in [*heard, *silent] or ["none"]),
        *(f"  receiver  {text}" for text in subscribers or ["none"]),
    ]
    return "\n".join(map(printable, lines))


main = partial(run_tool, build_parser, None)
