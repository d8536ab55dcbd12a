"""The same seed and commands give the same bytes: in other processes, and over a long time."""

import subprocess
import sys
from pathlib import Path

import pytest

from support.limits import LIMIT

RUN = """
import hashlib, math, sys
sys.path.insert(0, {tests!r})
from support.small_worlds import drive, make_maze, make_robot
import pytest
from zteam.sim import Engine, Options
robots = {{i: make_robot(-0.6 + 0.6 * (i % 3), -0.5 + 0.9 * (i // 3), 0.7 * i) for i in range(5)}}
options = Options(gaussian_noise=0.01, odom_alphas=(0.1, 0.1, 0.1, 0.1))
engine = Engine(make_maze(), robots={{}}, seed=7, options=options)
for i in {order}:
    engine.spawn(i, robots[i])
digest = hashlib.sha256()
for tick in range({ticks}):
    seen = engine.step({{i: drive(0.8, math.sin(0.1 * tick + i)) for i in robots}})
    for i, one in seen.robots.items():
        digest.update(repr((one.truth, one.odom, one.stall)).encode())
        digest.update(one.readings[0].ranges.tobytes())
print(digest.hexdigest())
"""


def run(order: str, ticks: int) -> str:
    """What a fresh process prints."""
    code = RUN.format(tests=str(Path(__file__).resolve().parents[3]), order=order, ticks=ticks)
    done = subprocess.run(
        [sys.executable, "-P", "-c", code], capture_output=True, text=True, timeout=3 * LIMIT, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


@pytest.mark.ci
def test_two_processes_agree_for_ten_thousand_steps() -> None:
    """Five robots that ram walls and each other, with noise: the same bytes, in whatever order they joined."""
    assert run("[0, 1, 2, 3, 4]", 10_000) == run("[4, 2, 0, 3, 1]", 10_000)
