"""The message exchange of a lock-step tick on bare Zenoh: the same number and sizes of messages, and nothing else.

It gives the shortest tick that the transport allows, without decoding, physics or behaviours. The study `floor` prints
it beside the team's own figure. `python -m studies.bare_zenoh ROLE ...` is one process of the exchange;
`studies.floor` starts them all. This module is the only one outside `bus/` that imports zenoh.
"""

import argparse
import os
import sys
import threading
from collections.abc import Callable, Iterable, Sequence
from contextlib import ExitStack

import msgspec
import zenoh

from zteam import names
from zteam.bus.options import BusOptions, client_config, open_session
from zteam.clock import HOST_FACTOR, monotonic, wait_until
from zteam.errors import BusError, ZteamError

START_LIMIT = 60.0 * HOST_FACTOR
"""Host seconds for all processes to start, and again for the warm-up."""
TICK_LIMIT = 2.0 * HOST_FACTOR
"""Host seconds after which a tick without all of its answers counts as lost."""
WARM_UP_TICKS = 100
"""Ticks before the measured ones."""

_OPEN_LIMIT_MS = 20_000
_STDIN = 0

# Payload sizes of zteam's own messages.
_TICK_BYTES = 100
_CLOCK_BYTES = 12
_TF_BYTES = 130
_ODOMETRY_BYTES = 720
_BUNDLE_BYTES_PER_ROBOT = 100
_DONE_BYTES = 80


class Exchanged(msgspec.Struct):
    """The simulator's measurement."""

    ticks: int
    """Ticks that every process answered."""
    seconds: float
    """Host seconds of all ticks, lost ones included."""
    lost: int


class Round:
    """Collects the keys of one tick that have arrived; thread-safe."""

    def __init__(self, size: int) -> None:
        self._size = size
        self._arrived: set[str] = set()
        self._lock = threading.Lock()

    def take(self, key: str) -> bool:
        """Note a message on `key`; return True once per tick, with the last of `size` keys."""
        with self._lock:
            if key in self._arrived:
                # The last tick lost a message: its other keys must not count for this tick.
                self._arrived.clear()
            self._arrived.add(key)
            if len(self._arrived) < self._size:
                return False
            self._arrived.clear()
            return True


def scan_bytes(beams: int) -> int:
    """Size of a scan's payload."""
    return 8 * beams + 76


def _tick_key() -> str:
    return names.service_key(names.SIMULATOR, "tick")


def _done_key(name: str) -> str:
    return names.service_key(name, "done")


def _open(endpoint: str, runtime: str) -> zenoh.Session:
    config = client_config(BusOptions(connect=endpoint))
    # The router listens, but may answer late while many processes start.
    config.insert_json5("connect/timeout_ms", str(_OPEN_LIMIT_MS))
    try:
        return open_session(config, runtime)
    except zenoh.ZError as error:
        reason = str(error).partition(" at /")[0].splitlines()[0]
        raise BusError(f"no session with the router at {endpoint}: {reason}") from None


def _publisher(session: zenoh.Session, key: str) -> zenoh.Publisher:
    return session.declare_publisher(key, congestion_control=zenoh.CongestionControl.DROP, express=False)


def _read(sample: zenoh.Sample) -> None:
    sample.payload.to_bytes()


def _wait_for_end_of_input() -> None:
    # Not sys.stdin: a thread that holds its lock breaks the interpreter's exit.
    while os.read(_STDIN, 4096):
        continue


def _take_part(
    session: zenoh.Session,
    name: str,
    awaited: Iterable[str],
    size: int,
    ignored: Iterable[str],
    answer: Callable[[], None],
) -> None:
    """Call `answer()` for each tick once messages on `size` keys of `awaited` have arrived, until input ends."""
    arrived = Round(size)

    def on_sample(sample: zenoh.Sample) -> None:
        _read(sample)
        if arrived.take(str(sample.key_expr)):
            answer()

    with ExitStack() as declared:
        for key in awaited:
            declared.enter_context(session.declare_subscriber(key, on_sample))
        for key in ignored:
            declared.enter_context(session.declare_subscriber(key, _read))
        # The token comes last: from here on no message is missed.
        token = names.token_key(name, str(session.zid()))
        declared.enter_context(session.liveliness().declare_token(token))
        _wait_for_end_of_input()


def run_aggregator(endpoint: str, robots: int) -> None:
    """Answer the transforms of all robots with one bundle, until input ends."""
    with _open(endpoint, "small") as session:
        bundle, done = _publisher(session, names.TF), _publisher(session, _done_key(names.AGGREGATOR))

        def answer() -> None:
            bundle.put(bytes(_BUNDLE_BYTES_PER_ROBOT * robots))
            done.put(bytes(_DONE_BYTES))

        transforms = names.all_robots_key(names.TF)
        _take_part(session, names.AGGREGATOR, [transforms], robots, [_tick_key(), names.CLOCK], answer)


def run_robot(endpoint: str, robot_id: int) -> None:
    """Answer each tick once the robot's scan, odometry and the transforms have arrived, until input ends."""
    with _open(endpoint, "small") as session:
        name = names.robot_name(robot_id)
        done = _publisher(session, _done_key(name))
        own = [names.robot_key(robot_id, topic) for topic in (names.BASE_SCAN, names.ODOM)]
        awaited = [_tick_key(), *own, names.TF]
        _take_part(session, name, awaited, len(awaited), [names.CLOCK], lambda: done.put(bytes(_DONE_BYTES)))


class _Simulator:
    """Publishes the messages of each tick and waits for the answers."""

    def __init__(self, session: zenoh.Session, robots: int, beams: int) -> None:
        ids = range(robots)
        self._team = {names.AGGREGATOR, *map(names.robot_name, ids)}
        self._present: set[str] = set()
        self._answered: set[str] = set()
        self._input_ended = False
        self._changed = threading.Condition()
        scan, odometry = bytes(scan_bytes(beams)), bytes(_ODOMETRY_BYTES)
        payloads = [
            (_tick_key(), bytes(_TICK_BYTES)),
            *((names.robot_key(i, names.TF), bytes(_TF_BYTES)) for i in ids),
            *((names.robot_key(i, names.ODOM), odometry) for i in ids),
            *((names.robot_key(i, names.BASE_SCAN), scan) for i in ids),
            (names.CLOCK, bytes(_CLOCK_BYTES)),
            *((names.robot_key(i, names.GROUND_TRUTH), odometry) for i in ids),
        ]
        self._messages = [(_publisher(session, key), payload) for key, payload in payloads]
        self._declared = [
            session.declare_subscriber(_done_key("*"), self._on_done),
            session.liveliness().declare_subscriber(names.tokens_key(), self._on_token, history=True),
        ]
        threading.Thread(target=self._watch_input, name="input", daemon=True).start()

    def _on_done(self, sample: zenoh.Sample) -> None:
        _read(sample)
        with self._changed:
            self._answered.add(str(sample.key_expr))
            if len(self._answered) == len(self._team):
                self._changed.notify()

    def _on_token(self, sample: zenoh.Sample) -> None:
        parts = names.split_token_key(str(sample.key_expr))
        if parts is not None:
            with self._changed:
                (self._present.add if sample.kind == zenoh.SampleKind.PUT else self._present.discard)(parts[0])
                self._changed.notify()

    def _watch_input(self) -> None:
        _wait_for_end_of_input()
        with self._changed:
            self._input_ended = True
            self._changed.notify()

    def _wait(self, ready: Callable[[], bool], timeout: float) -> bool:
        """Wait with the lock held; return whether it is ready. Raises ZteamError when input has ended."""
        is_ready = wait_until(self._changed, lambda: self._input_ended or ready(), timeout)
        if self._input_ended:
            raise ZteamError("standard input was closed before the end of the measurement")
        return is_ready

    def wait_for_team(self) -> None:
        """Wait until all other processes are present. Raises ZteamError that names the missing ones."""
        with self._changed:
            if not self._wait(lambda: self._team <= self._present, START_LIMIT):
                missing = ", ".join(sorted(self._team - self._present))
                raise ZteamError(f"{missing} did not start within {START_LIMIT:g} s")

    def _tick(self) -> bool:
        """Exchange one tick; return whether every process answered in time."""
        for publisher, payload in self._messages:
            publisher.put(payload)
        with self._changed:
            answered = self._wait(lambda: len(self._answered) == len(self._team), TICK_LIMIT)
            self._answered.clear()
        return answered

    def warm_up(self) -> None:
        """Exchange WARM_UP_TICKS ticks, lost ones included. Raises ZteamError if that takes too long."""
        deadline = monotonic() + START_LIMIT
        for tick in range(WARM_UP_TICKS):
            self._tick()
            if monotonic() > deadline:
                raise ZteamError(f"only {tick + 1} of {WARM_UP_TICKS} ticks of the warm-up within {START_LIMIT:g} s")

    def measure(self, seconds: float) -> Exchanged:
        """Exchange ticks for `seconds` host seconds."""
        begin, ticks, lost = monotonic(), 0, 0
        while (spent := monotonic() - begin) < seconds:
            if self._tick():
                ticks += 1
            else:
                lost += 1
        return Exchanged(ticks, spent, lost)


def run_simulator(endpoint: str, robots: int, beams: int, seconds: float) -> Exchanged:
    """Wait for `robots` robots and the aggregator, warm up, and measure for `seconds` host seconds."""
    with _open(endpoint, "usual") as session:
        simulator = _Simulator(session, robots, beams)
        simulator.wait_for_team()
        simulator.warm_up()
        return simulator.measure(seconds)


def _parse(argv: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m studies.bare_zenoh", description=__doc__)
    roles = parser.add_subparsers(dest="role", required=True)
    aggregator, robot, simulator = (roles.add_parser(role) for role in ("aggregator", "robot", "simulator"))
    for role in (aggregator, robot, simulator):
        role.add_argument("--connect", required=True, metavar="ENDPOINT", help="endpoint of the router")
    for role in (aggregator, simulator):
        role.add_argument("--robots", type=int, required=True, help="number of robots")
    robot.add_argument("--id", type=int, required=True, help="robot id")
    simulator.add_argument("--beams", type=int, required=True, help="beams of a scan")
    simulator.add_argument("--seconds", type=float, required=True, help="host seconds to measure for")
    return parser.parse_args(argv)


def main(argv: Sequence[str] | None = None) -> None:
    """Entry point. The simulator prints its `Exchanged` as one line of JSON."""
    args = _parse(argv)
    try:
        if args.role == "aggregator":
            run_aggregator(args.connect, args.robots)
        elif args.role == "robot":
            run_robot(args.connect, args.id)
        else:
            exchanged = run_simulator(args.connect, args.robots, args.beams, args.seconds)
            print(msgspec.json.encode(exchanged).decode(), flush=True)
    except ZteamError as error:
        sys.exit(str(error))


if __name__ == "__main__":
    main()
