"""Sessions of strangers that flood the bus: the team drives on, grows no memory, and `zteam doctor` names them."""

import json
import os
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
import zenoh

from support.limits import LIMIT
from zteam import names
from zteam.clock import pause
from zteam.team.testing.team import TeamFixture

pytestmark = pytest.mark.team

LARGE = bytes(50_000_000)
GARBAGE = bytes(100)
DROP, BLOCK = zenoh.CongestionControl.DROP, zenoh.CongestionControl.BLOCK
KEYS = ("robot_1/cmd_vel", "robot_1/base_scan", "robot_1/done", names.TF, names.TICK, "unknown", "unknown/{}")
LAST_TICK = 60
MOST_GROWTH = 40.0
"""Megabytes; a large message is more, and small ones are thousands."""


@contextmanager
def flood(team: TeamFixture, send: Callable[[zenoh.Session, int], None]) -> Iterator[str]:
    """A plain session in the team's namespace calls `send(session, number)` again and again; its id.

    The flood has begun when this yields, and goes on until the end.
    """
    config = zenoh.Config()
    settings = {"mode": "client", "connect/endpoints": [team.endpoint], "namespace": team.namespace}
    for key, value in {**settings, "scouting/multicast/enabled": False}.items():
        config.insert_json5(key, json.dumps(value))
    begun, over = threading.Event(), threading.Event()

    def work() -> None:
        number = 0
        while not over.is_set():
            send(session, number)
            number += 1
            if number > 2:
                begun.set()

    with zenoh.open(config) as session:
        thread = threading.Thread(target=work, daemon=True)
        thread.start()
        try:
            assert begun.wait(LIMIT)
            yield str(session.zid())
        finally:
            over.set()
            thread.join(LIMIT)


def send_large(session: zenoh.Session, number: int) -> None:
    """A message of 50 MB, one of two with BLOCK."""
    key = (names.TF, "robot_1/cmd_vel", "robot_1/base_scan")[number % 3]
    session.put(key, LARGE, congestion_control=(BLOCK, DROP)[number % 2])
    pause(0.2)


def send_many(session: zenoh.Session, number: int) -> None:
    """About 5000 messages a second, on each key in turn."""
    for i in range(50):
        session.put(KEYS[number % len(KEYS)].format(50 * number + i), GARBAGE)
    pause(0.01)


def memory(pids: dict[str, int]) -> dict[str, float]:
    """Megabytes of each process."""
    return {name: int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * 4096 / 1e6 for name, pid in pids.items()}


def test_a_flood_changes_no_run_and_grows_no_process(team: TeamFixture) -> None:
    """In lock-step the hash stays the same beside 50 MB messages with BLOCK, and beside 5000 messages a second on known
    and unknown keys; no process of the team keeps them."""
    team.start("office", robots=3, follow={1: 0, 2: 1})
    team.wait_for_go()
    pids = {name: team.pid(name) for name in (names.SIMULATOR, names.AGGREGATOR, names.MONITOR, "robot_0", "robot_1")}
    hashes, before = [], memory(pids)
    for send in (None, send_large, send_many):
        team.sim.reset()
        if send is None:
            team.at(LAST_TICK)
        else:
            with flood(team, send):
                team.at(LAST_TICK)
        hashes.append(team.report.trajectory_sha256)
        grown = {name: after - before[name] for name, after in memory(pids).items()}
        assert max(grown.values()) < MOST_GROWTH, grown
    assert hashes == hashes[:1] * 3
    assert team.report.hung == []
    assert not [line for name in pids for line in team.lines(name) if "router lost" in line]


def test_the_doctor_names_who_floods(team: TeamFixture) -> None:
    """The key, the rate, and of the session its id and its process; without the flood it has nothing to say."""
    team.start("office", robots=1)
    team.wait_for_go()
    with flood(team, send_many) as session:
        found = json.loads(team.command("doctor", "--json").stdout)
    assert any(each["what"] == "load" and "messages a second" in each["text"] for each in found), found
    named = next(each["text"] for each in found if each["what"] == "sessions")
    assert session in named
    assert f"process {os.getpid()} " in named
    quiet = json.loads(team.command("doctor", "--json").stdout)
    assert not [each for each in quiet if each["what"] in ("load", "sessions")], quiet
