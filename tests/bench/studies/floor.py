"""The floor of a lock-step tick: its messages through the router, in the same number and sizes, and nothing else.

It is the shortest tick that the transport allows, without decoding, physics or behaviours. This process exchanges the
messages of the simulator; `python -m studies.floor ENDPOINT ROBOTS [ID]` is the aggregator or a robot. No other module
outside `bus/` imports zenoh.
"""

import os
import sys
import threading
from collections.abc import Iterable, Sequence
from contextlib import ExitStack
from pathlib import Path

import msgspec
import zenoh

from studies.launching import LIMIT, launch
from zteam import names
from zteam.bus.options import BusOptions, client_config, open_session
from zteam.cli.bench import figure, measure_team
from zteam.clock import HOST_FACTOR, monotonic, wait_until
from zteam.errors import ZteamError
from zteam.team.launch.process import Job
from zteam.world import load_world

TICK_LIMIT = 2.0 * HOST_FACTOR
"""Host seconds after which a tick without all of its answers is lost."""
WARM_UP_TICKS = 100
_SECONDS = 4.0
"""Host seconds that are measured."""
_OPEN_LIMIT_MS = 20_000

# Payload sizes of zteam's own messages.
_TICK_BYTES, _CLOCK_BYTES, _TF_BYTES, _ODOMETRY_BYTES, _BUNDLE_BYTES_PER_ROBOT, _DONE_BYTES = 100, 12, 130, 720, 100, 80
_TICK = names.service_key(names.SIMULATOR, "tick")

Message = tuple[str, int]
"""A key, and the size of a payload."""


class FloorFigures(msgspec.Struct):
    """A team in lock-step, and the same exchange of messages right after it."""

    robots: int
    beams: int
    rtf: float
    """Of the team: simulated seconds a host second."""
    floor_rtf: float
    """The same if a tick only exchanged messages."""
    ratio: float
    """rtf / floor_rtf; 1 is as fast as the transport alone."""


def measure_floor(world: Path, robots: int, beams: int, seconds: float) -> FloorFigures:
    """Run a line of robots (`zteam bench team`), then the exchange of its messages. Raises ZteamError."""
    rtf = measure_team(world, robots, beams, seconds)["rtf"]
    if not rtf:
        raise ZteamError("the team was over before GO: give more --seconds")
    floor = _exchange(robots, beams) * load_world(world).interval / 1e9
    return FloorFigures(robots, beams, rtf, floor, rtf / floor)


def format_floor(found: FloorFigures) -> str:
    """One line."""
    factors = f"team {figure(found.rtf)}, bare Zenoh {figure(found.floor_rtf)} simulated seconds a second"
    return f"{found.robots} robots, {found.beams} beams: {factors}; team / bare Zenoh {figure(found.ratio)}"


def _exchange(robots: int, beams: int) -> float:
    """Ticks a host second."""
    command = [sys.executable, "-P", "-m", "studies.floor"]
    with launch() as processes:
        endpoint = processes.start_router()
        processes.supervisor.start_job(names.AGGREGATOR, Job([*command, endpoint, str(robots)]))
        for i in range(robots):
            processes.supervisor.start_job(names.robot_name(i), Job([*command, endpoint, str(robots), str(i)]))
        with _open(endpoint, "usual") as session:
            simulator = _Simulator(session, robots, beams)
            simulator.wait_for_team()
            for _ in range(WARM_UP_TICKS):
                simulator.tick()
            begin, ticks = monotonic(), 0
            while (spent := monotonic() - begin) < _SECONDS:
                ticks += simulator.tick()
    if not ticks:
        raise ZteamError(f"not one tick was answered in {spent:.1f} s")
    return ticks / spent


class _Simulator:
    """Publishes the messages of each tick and waits for the answers."""

    def __init__(self, session: zenoh.Session, robots: int, beams: int) -> None:
        ids = range(robots)
        self._team = {names.AGGREGATOR, *map(names.robot_name, ids)}
        self._present: set[str] = set()
        self._answered: set[str] = set()
        self._changed = threading.Condition()
        odometry, scan = _ODOMETRY_BYTES, 8 * beams + 76
        topics = ((names.TF, _TF_BYTES), (names.ODOM, odometry), (names.BASE_SCAN, scan))
        of_robots = [(names.robot_key(i, topic), size) for topic, size in topics for i in ids]
        truths = [(names.robot_key(i, names.GROUND_TRUTH), odometry) for i in ids]
        self._messages = _publishers(session, [(_TICK, _TICK_BYTES), *of_robots, (names.CLOCK, _CLOCK_BYTES), *truths])
        self._declared = [
            session.declare_subscriber(_done_key("*"), self._on_done),
            session.liveliness().declare_subscriber(names.tokens_key("*"), self._on_token, history=True),
        ]

    def _on_done(self, sample: zenoh.Sample) -> None:
        sample.payload.to_bytes()
        with self._changed:
            self._answered.add(str(sample.key_expr))
            if len(self._answered) == len(self._team):
                self._changed.notify()

    def _on_token(self, sample: zenoh.Sample) -> None:
        parts = names.split_token_key(str(sample.key_expr))
        if parts is not None:
            with self._changed:
                self._present.add(parts[0])
                self._changed.notify()

    def wait_for_team(self) -> None:
        """Wait until all other processes are present. Raises ZteamError that names the missing ones."""
        with self._changed:
            if not wait_until(self._changed, lambda: self._team <= self._present, LIMIT):
                raise ZteamError(f"{', '.join(sorted(self._team - self._present))} did not start within {LIMIT:g} s")

    def tick(self) -> bool:
        """Exchange one tick; return whether every process answered in time."""
        for publisher, payload in self._messages:
            publisher.put(payload)
        with self._changed:
            answered = wait_until(self._changed, lambda: len(self._answered) == len(self._team), TICK_LIMIT)
            self._answered.clear()
        return answered


def _take_part(
    session: zenoh.Session, name: str, awaited: Iterable[str], size: int, ignored: Iterable[str],
    answers: Sequence[Message],
) -> None:  # fmt: skip
    """Publish the answers to each tick once messages on `size` keys of `awaited` have arrived, until input ends."""
    publishers = _publishers(session, answers)
    arrived, lock = set[str](), threading.Lock()

    def on_sample(sample: zenoh.Sample) -> None:
        sample.payload.to_bytes()
        key = str(sample.key_expr)
        with lock:
            if key in arrived:
                # The last tick lost a message: its other keys must not count for this tick.
                arrived.clear()
            arrived.add(key)
            if len(arrived) < size:
                return
            arrived.clear()
        for publisher, payload in publishers:
            publisher.put(payload)

    with ExitStack() as declared:
        for key in awaited:
            declared.enter_context(session.declare_subscriber(key, on_sample))
        for key in ignored:
            declared.enter_context(session.declare_subscriber(key, lambda sample: sample.payload.to_bytes()))
        # The token comes last: from here on no message is missed.
        declared.enter_context(session.liveliness().declare_token(names.token_key(name, str(session.zid()))))
        # Not sys.stdin: a thread that holds its lock breaks the interpreter's exit.
        while os.read(0, 4096):
            continue


def _publishers(session: zenoh.Session, messages: Iterable[Message]) -> list[tuple[zenoh.Publisher, bytes]]:
    drop = zenoh.CongestionControl.DROP
    return [(session.declare_publisher(key, congestion_control=drop, express=False), bytes(n)) for key, n in messages]


def _done_key(name: str) -> str:
    return names.service_key(name, "done")


def _open(endpoint: str, runtime: str) -> zenoh.Session:
    config = client_config(BusOptions(connect=endpoint))
    # The router listens, but may answer late while many processes start.
    config.insert_json5("connect/timeout_ms", str(_OPEN_LIMIT_MS))
    return open_session(config, runtime)


def main(endpoint: str, robots: int, robot_id: int | None = None) -> None:
    """The aggregator, or a robot, until input ends."""
    with _open(endpoint, "small") as session:
        if robot_id is None:
            name, awaited, size = names.AGGREGATOR, [names.all_robots_key(names.TF)], robots
            ignored = [_TICK, names.CLOCK]
            answers = [(names.TF, _BUNDLE_BYTES_PER_ROBOT * robots)]
        else:
            own = [names.robot_key(robot_id, topic) for topic in (names.BASE_SCAN, names.ODOM)]
            name, awaited, size = names.robot_name(robot_id), [_TICK, *own, names.TF], 4
            ignored, answers = [names.CLOCK], []
        _take_part(session, name, awaited, size, ignored, [*answers, (_done_key(name), _DONE_BYTES)])


if __name__ == "__main__":
    main(sys.argv[1], *map(int, sys.argv[2:]))
