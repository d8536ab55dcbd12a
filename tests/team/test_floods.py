"""Sessions of strangers that flood the bus: the team drives on, grows no memory, and `zteam doctor` lists them."""

import json
import re
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from functools import partial
from pathlib import Path

import pytest
import zenoh

from support.limits import LIMIT
from zteam import names
from zteam.clock import pause
from zteam.messages import Header, RobotStatus, TFMessage, Time, TransformStamped, Twist, Vector3, encode
from zteam.node.kinds import ROUTER
from zteam.team.testing.team import TeamFixture

pytestmark = pytest.mark.team

LARGE = bytes(50_000_000)
GARBAGE = bytes(100)
BACKWARDS = encode(Twist(Vector3(-1.0)))
DROP, BLOCK = zenoh.CongestionControl.DROP, zenoh.CongestionControl.BLOCK
TOPICS = (names.CMD_VEL, names.BASE_SCAN, names.STATUS, names.DONE)
KEYS = (*(f"robot_1/{topic}" for topic in TOPICS), names.TF, names.TICK, "unknown", "unknown/{}")
ALL_ROBOTS = names.all_robots_key(names.CMD_VEL)
BURST = 50
LAST_TICK = 60
MOST_GROWTH = 20.0
"""Megabytes; a large message is more, and small ones are thousands."""
MOST_ROUTER_GROWTH, LARGE_ONES = 200.0, 8
"""The router keeps the place of the pieces of some large messages, but not of so many."""
INVENTED, FIRST_INVENTED, WITH_TOKEN = 2000, 100, 300
"""Robots; the first of them; those that have a token, of which each makes work for all processes."""
TAKES_NOTHING = """
import sys, zenoh
with zenoh.open(zenoh.Config.from_json5(sys.argv[1])) as session:
    kept = session.declare_subscriber("**")
    sys.stdout.write("subscribed\\n")
    sys.stdout.flush()
    sys.stdin.read()
"""


def settings_of(team: TeamFixture) -> str:
    """The configuration of a plain client in the team's namespace."""
    client = {"mode": "client", "connect": {"endpoints": [team.endpoint]}, "namespace": team.namespace}
    return json.dumps({**client, "scouting": {"multicast": {"enabled": False}}})


@contextmanager
def flood(team: TeamFixture, send: Callable[[zenoh.Session, int], object], first: int = 3) -> Iterator[str]:
    """A plain session in the team's namespace calls `send(session, number)` again and again; its id.

    This yields after the `first` calls, and the flood goes on until the end.
    """
    begun, over = threading.Event(), threading.Event()

    def work() -> None:
        number = 0
        while not over.is_set():
            send(session, number)
            number += 1
            if number >= first:
                begun.set()

    with zenoh.open(zenoh.Config.from_json5(settings_of(team))) as session:
        thread = threading.Thread(target=work, daemon=True)
        thread.start()
        try:
            assert begun.wait(LIMIT)
            yield str(session.zid())
        finally:
            over.set()
            thread.join(LIMIT)


@contextmanager
def slow_subscriber(team: TeamFixture) -> Iterator[None]:
    """A plain process subscribes to everything and takes no message."""
    command = [sys.executable, "-c", TAKES_NOTHING, settings_of(team)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        try:
            assert process.stdout.readline() == "subscribed\n"
            yield
        finally:
            process.kill()


def send_large(session: zenoh.Session, number: int) -> None:
    """A message of 50 MB, one of two with BLOCK."""
    key = (names.TF, "robot_1/cmd_vel", "robot_1/base_scan")[number % 3]
    session.put(key, LARGE, congestion_control=(BLOCK, DROP)[number % 2])
    pause(0.2)


def send_many(session: zenoh.Session, number: int) -> None:
    """About 5000 messages a second, on each key in turn."""
    send_on(KEYS[number % len(KEYS)], GARBAGE, session, number)


def send_on(key: str, payload: bytes, session: zenoh.Session, number: int) -> None:
    """About 5000 messages a second on one key."""
    for i in range(BURST):
        session.put(key.format(BURST * number + i), payload)
    pause(0.01)


def invent_robots(session: zenoh.Session, number: int) -> None:
    """Statuses, tokens, commands and frames of ever further robots."""
    for i in range(BURST * number, BURST * (number + 1)):
        robot_id = FIRST_INVENTED + i % 9000
        name = names.robot_name(robot_id)
        if i < WITH_TOKEN:
            session.liveliness().declare_token(names.token_key(name, f"{i:032x}"))
        session.put(names.robot_key(robot_id, names.STATUS), encode(RobotStatus(robot_id=robot_id, is_ready=True)))
        session.put(names.robot_key(robot_id, names.CMD_VEL), BACKWARDS)
        frame = TransformStamped(Header(stamp=Time(5), frame_id=names.MAP_FRAME), f"{name}/base_link")
        session.put(names.TF, encode(TFMessage([frame])))
    pause(0.01)


def memory(pids: dict[str, int]) -> dict[str, float]:
    """Megabytes of each process."""
    return {name: int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * 4096 / 1e6 for name, pid in pids.items()}


def watched(team: TeamFixture) -> dict[str, int]:
    """Process ids of those that a flood must not grow."""
    named = (ROUTER, names.SIMULATOR, names.AGGREGATOR, names.MONITOR, "robot_0", "robot_1")
    return {name: team.pid(name) for name in named}


def run_beside(team: TeamFixture, flooding: AbstractContextManager[object]) -> str:
    """The hash of a run of lock-step beside a flood."""
    team.sim.reset()
    with flooding:
        team.at(LAST_TICK)
    return team.report.trajectory_sha256


def test_a_flood_changes_no_run_and_grows_no_process(team: TeamFixture) -> None:
    """In lock-step the hash stays the same beside a subscriber that takes nothing, 50 MB messages with BLOCK, 5000
    messages a second on known and unknown keys and for all robots, and invented robots, which have few lines in the
    log. No process of the team keeps the messages, and the router not the place of all large ones."""
    team.start("office", robots=3, follow={1: 0, 2: 1})
    team.wait_for_go()
    pids = watched(team)
    # What the simulator takes for its first runs is no growth.
    hashes = [run_beside(team, nullcontext()) for _ in range(5)]
    at_first = memory(pids)
    for flooding in (
        slow_subscriber(team),
        flood(team, send_large, LARGE_ONES),
        flood(team, send_many),
        flood(team, partial(send_on, ALL_ROBOTS, BACKWARDS)),
        flood(team, invent_robots, INVENTED // BURST),
    ):
        before = memory(pids)
        hashes.append(run_beside(team, flooding))
        now = memory(pids)
        grown = {name: now[name] - before[name] for name in pids if name != ROUTER}
        assert max(grown.values()) < MOST_GROWTH, grown
        assert now[ROUTER] - at_first[ROUTER] < MOST_ROUTER_GROWTH
    assert hashes == hashes[:1] * len(hashes)
    assert team.report.hung == []
    assert not [line for name in pids for line in team.lines(name) if "router lost" in line]
    told = [line for _, line in team._watch.log if re.search(r"robot_\d{3}", line)]
    assert len(told) < INVENTED / 4, told[-20:]


def all_drive(team: TeamFixture, robot_ids: Sequence[int]) -> None:
    """Wait until each of these robots has driven 30 cm from now on."""
    goals = {i: team.robot(i).distance_travelled + 0.3 for i in robot_ids}
    team.until(lambda: all(team.robot(i).distance_travelled > goal for i, goal in goals.items()), within=60.0)


@pytest.mark.real_time
def test_robots_drive_beside_a_flood(team: TeamFixture) -> None:
    """In real time all do, but for the one whose velocity is flooded with valid ones; where all keys are flooded at
    once by `**` they do afterwards, and no process has grown."""
    team.start("office", robots=3, lockstep=False)
    team.wait_for_go()
    all_drive(team, (0, 1, 2))
    for flooding, driving in (
        (flood(team, send_large), (0, 1, 2)),
        (flood(team, partial(send_on, "robot_1/cmd_vel", BACKWARDS)), (0, 2)),
        (flood(team, invent_robots), (0, 1, 2)),
    ):
        with flooding:
            all_drive(team, driving)
    pids = watched(team)
    before = memory(pids)
    with flood(team, partial(send_on, "**", GARBAGE), first=100):
        pass
    all_drive(team, (0, 1, 2))
    grown = {name: after - before[name] for name, after in memory(pids).items()}
    assert max(grown.values()) < MOST_GROWTH, grown


def test_the_doctor_names_who_floods(team: TeamFixture) -> None:
    """The key, the rate, and of the session its id; without the flood it has nothing to say."""
    team.start("office", robots=1)
    team.wait_for_go()
    with flood(team, partial(send_on, names.TF, GARBAGE)) as session:
        found = json.loads(team.command("doctor", "--json").stdout)
    assert any(each["what"] == "load" and "messages a second" in each["text"] for each in found), found
    named = next(each["text"] for each in found if each["what"] == "sessions")
    assert session in named
    quiet = json.loads(team.command("doctor", "--json").stdout)
    assert not [each for each in quiet if each["what"] in ("load", "sessions")], quiet
