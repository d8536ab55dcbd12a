"""Lasers on two threads: the same bits as on one, and threads that end."""

import gc
import os
import subprocess
import sys
import threading
from pathlib import Path

import msgspec
import numpy as np
import pytest

from support.limits import LIMIT
from support.small_worlds import LASER, drive, make_box, make_maze, make_robot, plain_kernels
from zteam.sim import Engine, Options
from zteam.world.model import World

pytestmark = pytest.mark.ci

MANY = msgspec.structs.replace(LASER, samples=1081, fov=4.7)
TESTS = Path(__file__).resolve().parents[2]


def make_team(robots: int = 12, boxes: int = 3, seed: int = 0) -> World:
    """Robots with enough beams for two threads, in a maze with boxes."""
    random = np.random.default_rng(seed)
    places = [(*random.uniform(-0.7, 0.7, 2), random.uniform(-3.0, 3.0)) for _ in range(robots)]
    team = [make_robot(*place, rangers=(MANY,)) for place in places]
    things = tuple(make_box(f"b{i}", *random.uniform(-3.0, 3.0, 2)) for i in range(boxes))
    return msgspec.structs.replace(make_maze(*team, seed=seed), obstacles=things)


def helpers() -> list[threading.Thread]:
    """The helping threads of this process."""
    return [thread for thread in threading.enumerate() if thread.name == "lasers"]


def scan(world: World, ticks: int, options: Options) -> list[bytes]:
    """What all robots measure in a few ticks: ranges and intensities."""
    engine = Engine(world, options=options)
    seen = [engine.step({i: drive(0.5, 0.3 * i) for i in engine.robots}) for _ in range(ticks)]
    readings = [one.readings[0] for step in seen for one in step.robots.values()]
    return [part.tobytes() for reading in readings for part in (reading.ranges, reading.intensities)]


@pytest.fixture
def processors(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The processors that this process may use, which a test may change."""
    allowed = [0, 1]
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: set(allowed))
    return allowed


@pytest.mark.few(3)
@pytest.mark.parametrize("options", [Options(), Options(gaussian_noise=0.01)], ids=["exact", "noisy"])
@pytest.mark.parametrize("seed", range(6))
def test_two_threads_measure_what_one_does(processors: list[int], seed: int, options: Options) -> None:
    """In random worlds every bit of every scan is the same on two threads, on one, and without compiled kernels."""
    robots, boxes = 10 + 3 * seed, 4 * (seed % 3)
    world = make_team(robots, boxes, seed)
    on_two = scan(world, 20, options)
    processors.remove(1)
    assert scan(world, 20, options) == on_two
    with plain_kernels():
        assert scan(world, 3, options) == on_two[: 3 * robots * 2]


def test_the_rays_may_be_cast_beside_the_caller(processors: list[int]) -> None:
    """An engine that begins to observe early senses what one does that observes at once; its bases do so at once."""
    world = make_team()
    at_once, early = Engine(world), Engine(world)
    for tick in range(20):
        commands = {i: drive(0.5, 0.3 * i) for i in at_once.robots} if tick % 3 else {}
        early.move(commands)
        bases = early.begin_observing()
        seen = [at_once.step(commands), early.observe()]
        one, other = ([robot.readings[0].ranges.tobytes() for robot in each.robots.values()] for each in seen)
        assert one == other
        one, other = ([(robot.odom, robot.velocity) for robot in each.robots.values()] for each in (bases, seen[0]))
        assert one == other


def test_a_second_thread_only_where_it_pays(processors: list[int]) -> None:
    """Few rays, one processor or plain kernels: no thread is started; otherwise one, whatever the number of ticks."""
    few, many = make_team(4), make_team(12)
    known = set(helpers())
    engines = [Engine(few), Engine(many), Engine(many)]
    with plain_kernels():
        engines[1].step({})
    engines[0].step({})
    processors.remove(1)
    engines[2].step({})
    processors.append(1)
    assert not set(helpers()) - known
    for _ in range(3):
        engines[1].step({})
    assert len(set(helpers()) - known) == 1


@pytest.mark.ci
def test_threads_end_with_their_engines(processors: list[int]) -> None:
    """After a hundred engines no helping thread is left."""
    world, known = make_team(), set(helpers())
    for _ in range(100):
        Engine(world).step({})
    gc.collect()
    for thread in set(helpers()) - known:
        thread.join(LIMIT)
    assert not set(helpers()) - known


RUN = f"""
import hashlib, os, sys, time
sys.path[:0] = {[str(TESTS), str(TESTS / "unit" / "sim")]!r}
os.sched_getaffinity = lambda _: {{0, 1}}
from test_cast_pair import drive, helpers, make_team
from zteam.sim import Engine
from zteam.sim import cast_pair, jit
engine = Engine(make_team(100))
pair, = engine._assembled()._lasers._pairs
def step():
    return engine.step({{i: drive(0.5, 0.3 * i) for i in engine.robots}})
step()
"""


def run(code: str) -> list[str]:
    """Lines that a fresh process prints; it must end by itself."""
    done = subprocess.run(
        [sys.executable, "-P", "-c", RUN + code], capture_output=True, text=True, timeout=3 * LIMIT, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


@pytest.mark.ci
def test_the_helper_helps() -> None:
    """The second thread does a part of the scans while the first is at work, and the process ends with both of them."""
    code = """
until = time.monotonic() + 100.0
end = cast_pair._END
while pair._state[end] in (0, 100) and time.monotonic() < until:
    step()
print(pair._state[end] not in (0, 100), len(helpers()))
"""
    assert run(code) == ["True 1"]


@pytest.mark.ci
def test_a_forked_child_measures_without_the_thread() -> None:
    """A child, which has no helping thread, senses what its parent does."""
    code = """
def digest():
    found = [step().robots[i].readings[0].ranges.tobytes() for i in engine.robots]
    return hashlib.sha256(b"".join(found)).hexdigest()
step()
child = os.fork()
print(digest(), flush=True)
if child:
    assert os.waitpid(child, 0)[1] == 0
"""
    one, other = run(code)
    assert one == other
