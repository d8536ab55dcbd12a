"""Processes that are stopped (SIGSTOP) in the middle of a lock-step run and go on later: the run stays the same.

ZTEAM_FREEZES=50 draws as many freezes, of up to 8 s; the suite has a few short ones, and one longer than the lease of
real time.
"""

import json
import logging
import os
import random
import subprocess
import threading
from pathlib import Path
from typing import NamedTuple

import pytest

from support.freezing import descendants_of, freeze
from support.limits import LIMIT
from zteam import names
from zteam.messages import Log, RobotStatus, Tick
from zteam.team.launch.process import zteam_command
from zteam.team.testing.team import TeamFixture

pytestmark = pytest.mark.team

LAST_TICK = 100
PROCESSES = ("router", names.SIMULATOR, names.AGGREGATOR, names.MONITOR, "robot_0", "robot_1", "robot_2")
DRAWS = int(os.environ.get("ZTEAM_FREEZES", "0"))
CHANCE = random.Random(24)


class Freeze(NamedTuple):
    """Processes that are stopped together, in which tick, and for how many seconds of the host."""

    stopped: tuple[str, ...]
    tick: int
    seconds: float


def draw() -> Freeze:
    """A freeze of one process, or one time in eight of all of them. The draws are the same in every run."""
    stopped = CHANCE.choice([*((name,) for name in PROCESSES), PROCESSES])
    return Freeze(stopped, CHANCE.randrange(1, LAST_TICK - 10), CHANCE.uniform(0.1, 8.0))


FREEZES = [draw() for _ in range(DRAWS)] or [Freeze(("router",), 30, 2.5), Freeze((names.SIMULATOR,), 20, 0.3)]
LAUNCHES = [(CHANCE.randrange(3, 23), *draw()) for _ in range(DRAWS // 5)] or [(20, PROCESSES, 0, 2.5)]
"""The line of the launcher's output after which the freeze comes (a robot's GO at the latest), and the freeze."""


def run_with(team: TeamFixture, given: Freeze | None) -> str:
    """The hash of the run from the first tick to LAST_TICK, with this freeze in it."""
    pids = [team.pid(name) for name in given.stopped] if given else []
    due, frozen = threading.Event(), threading.Event()

    def stop_and_continue() -> None:
        due.wait()
        if given and pids:
            freeze(pids, given.seconds)
            frozen.set()

    def on_tick(_key: str, tick: Tick) -> None:
        if given and tick.tick >= given.tick:
            due.set()

    stopper = threading.Thread(target=stop_and_continue)
    stopper.start()
    heard = team.bus.subscribe(names.TICK, Tick, on_tick)
    try:
        team.sim.reset()
        team.at(LAST_TICK)
        assert not given or due.is_set()
    finally:
        heard.close()
        due.set()
        stopper.join(LIMIT)
    assert frozen.is_set() == bool(given)
    assert team.report.hung == [], given
    return team.report.trajectory_sha256


def test_a_freeze_does_not_change_the_run(team: TeamFixture) -> None:
    """Any process, or all of them, is stopped at any tick for less than the time-out: the hash stays the same."""
    team.start("office", robots=3, follow={1: 0, 2: 1})
    team.wait_for_go()
    undisturbed = run_with(team, None)
    for number, given in enumerate(FREEZES, start=1):
        assert run_with(team, given) == undisturbed, f"{number}: {given}"


@pytest.mark.parametrize(("line", "stopped", "tick", "seconds"), LAUNCHES)
def test_a_freeze_of_a_launch_does_not_change_the_run(
    tmp_path: Path, line: int, stopped: tuple[str, ...], tick: int, seconds: float
) -> None:
    """`zteam up`, or one of its processes, is stopped at its start or later: the hash is that of one process."""
    # It lasts 3 s at least, so that the freeze comes before the end.
    run = ("up", "line", "--lockstep", "--speed", "10", "--for", "30", "--report")
    subprocess.run(zteam_command("zteam", *run, "one.json", "--in-process"), cwd=tmp_path, check=True, timeout=LIMIT)
    command = zteam_command("zteam", *run, "frozen.json")
    pipe, nothing = subprocess.PIPE, subprocess.DEVNULL
    with subprocess.Popen(
        command, cwd=tmp_path, stdin=nothing, stdout=pipe, stderr=subprocess.STDOUT, text=True
    ) as launcher:
        try:
            assert launcher.stdout is not None
            said = [launcher.stdout.readline()]
            # How many lines come before GO is chance, and after it few come until the end.
            while len(said) < line and "All robots GO!" not in said[-1]:
                said.append(launcher.stdout.readline())
            family = [launcher.pid, *descendants_of(launcher.pid)]
            assert launcher.poll() is None, said
            freeze(family if len(stopped) > 1 else [family[tick % len(family)]], seconds)
            said += launcher.stdout.readlines()
            assert launcher.wait(LIMIT) == 0, "".join(said)
        finally:
            launcher.kill()
    one, frozen = (json.loads((tmp_path / name).read_text()) for name in ("one.json", "frozen.json"))
    assert (frozen["hung"], frozen["trajectory_sha256"]) == ([], one["trajectory_sha256"]), "".join(said)


OTHERS = [pytest.param(name, marks=pytest.mark.ci) for name in PROCESSES if name != "robot_1"]


@pytest.mark.real_time
@pytest.mark.parametrize("frozen", ["robot_1", *OTHERS])
def test_a_line_goes_on_after_a_freeze_in_real_time(team: TeamFixture, frozen: str) -> None:
    """The frozen process says so, no other process is named but as the one that is silent, and the line drives on as
    before: it is not led from its other end."""
    team.start("office", robots=3, behavior="wander", follow={1: 0, 2: 1}, lockstep=False)
    team.wait_for_go()
    team.until(lambda: all(team.robot(i).speed > 0.1 for i in range(3)), within=60.0)
    lines, turns = list[Log](), list[int]()
    team.bus.subscribe(names.all_robots_key(names.STATUS), RobotStatus, lambda _key, status: turns.append(status.turns))
    team.bus.subscribe(names.log_key("*"), Log, lambda _key, line: lines.append(line))
    # A router drops what is silent.
    team.expect_end(frozen)
    freeze([team.pid(frozen)], 5.0)
    goals = {i: team.robot(i).distance_travelled + 0.5 for i in range(3)}
    team.until(lambda: all(team.robot(i).distance_travelled > goal for i, goal in goals.items()), within=60.0)
    assert set(turns) == {0}
    told = [(line.name, line.msg) for line in lines if line.level >= logging.WARNING]
    if frozen != "router":
        team.wait_for_line(frozen, "was frozen")
    innocent = [name for name in PROCESSES if name.startswith("robot") and name != frozen]
    # A line about the process's own keys blames no other process.
    assert [each for each in told if any(name in each[1] for name in innocent if name != each[0])] == []
