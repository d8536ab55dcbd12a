"""The same seed and commands give the same bytes: in other processes, over a long time, and without numba."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from support.limits import LIMIT

RUN = """
import hashlib, math, sys
sys.path.insert(0, {tests!r})
{before}
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


def run(order: str, ticks: int, before: str = "") -> str:
    """What a fresh process prints; the zteam that is tested is imported, whose kernels are compiled already."""
    code = RUN.format(tests=str(Path(__file__).resolve().parents[2]), before=before, order=order, ticks=ticks)
    done = subprocess.run(
        [sys.executable, "-P", "-c", code], capture_output=True, text=True, timeout=3 * LIMIT, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


@pytest.mark.ci
def test_two_processes_agree_for_ten_thousand_steps() -> None:
    """Five robots that ram walls and each other, with noise: the same bytes, in whatever order they joined."""
    assert run("[0, 1, 2, 3, 4]", 10_000) == run("[4, 2, 0, 3, 1]", 10_000)


def test_the_core_runs_without_numba_and_says_so() -> None:
    """Where numba is missing the same world is simulated on numpy, with a warning, to the same readings."""
    code = """
import logging, sys
sys.path.insert(0, {tests!r})
{before}
logging.basicConfig(level=logging.WARNING, stream=sys.stdout, format="%(message)s")
from support.small_worlds import drive, make_box, make_maze, make_robot
from zteam.sim import Engine, Options
for physics in ("dynamic", "stage", "kinematic"):
    robots = {{i: make_robot(-0.6 + 0.6 * i, 0.1 * i, 0.7 * i) for i in range(3)}}
    engine = Engine(make_maze(), robots=robots, options=Options(physics=physics))
    for tick in range(12):
        seen = engine.step({{i: drive(0.8, 0.5 * i - 0.5) for i in robots}})
    for one in seen.robots.values():
        print(*(f"{{v:.6f}}" for v in (*one.truth, *one.odom, *one.velocity)), one.stall)
        print(*(f"{{v:.4f}}" for v in one.readings[0].ranges.tolist()), one.readings[0].intensities.sum())
"""
    tests = str(Path(__file__).resolve().parents[2])
    outputs = []
    for before in ("", "sys.modules['numba'] = None"):
        script = code.format(tests=tests, before=before)
        done = subprocess.run(
            [sys.executable, "-P", "-c", script], capture_output=True, text=True, timeout=3 * LIMIT, check=False
        )
        assert done.returncode == 0, done.stderr
        outputs.append(done.stdout.splitlines())
    with_numba, (warning, *without_numba) = outputs
    assert "numba is not installed" in warning
    assert without_numba == with_numba


@pytest.mark.ci
def test_kernels_are_kept_apart_from_the_package(tmp_path: Path) -> None:
    """Also where numba was imported first, compiled code goes to the chosen folder, not beside the source."""
    code = "import numba; from zteam.sim import jit; jit.use_compiled(); print(numba.config.CACHE_DIR)"
    environment = {key: value for key, value in os.environ.items() if key != "NUMBA_CACHE_DIR"}
    done = subprocess.run(
        [sys.executable, "-P", "-c", code],
        env=environment | {"XDG_CACHE_HOME": str(tmp_path)},
        capture_output=True,
        text=True,
        timeout=LIMIT,
        check=False,
    )
    assert Path(done.stdout.strip()).parent == tmp_path / "zteam" / "numba", done.stderr
