"""The robots' kernels give without numba what the compiled ones give, to the last bit."""

import math
import subprocess
import sys
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np
import pytest

from support.examples import SHARE
from support.limits import LIMIT
from zteam.behaviors.jit import BEHAVIOR_KERNELS
from zteam.behaviors.safety.swept import Motion, Outline, meeting_time
from zteam.behaviors.scan_kernels import interpret
from zteam.compiling import takeover
from zteam.compiling.kernels import has_numba

pytestmark = pytest.mark.skipif(not has_numba(), reason="numba is not installed")
CASES = round(400 * max(SHARE, 0.25))
ODD = np.array((math.nan, math.inf, -math.inf, 0.0, -0.0, -1.0, 1e-7, 0.01, 0.02, 29.9, 30.0, 31.0))
"""Ranges that mean something of their own with a laser of 0.02 to 30 m."""


@pytest.fixture(autouse=True)
def _kept() -> Iterator[None]:
    takeover.fill_cache(BEHAVIOR_KERNELS)
    yield
    BEHAVIOR_KERNELS.use_kept()


def both(call: Callable[[], tuple[Any, ...]]) -> tuple[Any, ...]:
    """What `call` gives with either kind of kernel, which is the same."""
    BEHAVIOR_KERNELS.use_kept()
    assert BEHAVIOR_KERNELS.choice, "the kernels are not kept"
    compiled = call()
    BEHAVIOR_KERNELS.use_plain()
    for one, other in zip(compiled, call(), strict=True):
        if isinstance(one, np.ndarray):
            assert one.tobytes() == other.tobytes()
        else:
            assert one == other
    return compiled


def scan(rng: np.random.Generator) -> np.ndarray:
    """Ranges of a scan; in most scans some are odd."""
    ranges = rng.uniform(0.0, 32.0, int(rng.integers(1, 60))).round(int(rng.integers(0, 5)))
    if rng.random() < 0.8:
        at = rng.random(ranges.size) < rng.uniform(0.0, 1.0)
        ranges[at] = rng.choice(ODD, int(at.sum()))
    return ranges


def test_ranges_are_read_in_the_same_way() -> None:
    """Ranges at the limits of the laser and beyond, and those that are no distances."""
    rng, all_spoke = np.random.default_rng(1), 0
    for _ in range(CASES):
        given, limits = scan(rng), (float(rng.choice((0.0, 0.02, math.nan))), float(rng.choice((30.0, math.inf))))

        def read(given: np.ndarray = given, limits: tuple[float, float] = limits) -> tuple[Any, ...]:
            ranges = given.copy()
            return interpret(ranges, *limits, limits[1] * 0.999), ranges

        all_spoke += both(read)[0]
    assert 10 < all_spoke < CASES - 10


def cloud(rng: np.random.Generator, least: int = 0) -> np.ndarray:
    """Points; some lie on a lattice."""
    points = rng.uniform(-3.0, 3.0, (2, int(rng.integers(least, 60))))
    return points.round(1) if rng.random() < 0.5 else points


def outline(rng: np.random.Generator) -> Outline:
    """Three to seven corners; some a little more than a line."""
    corners = rng.uniform(-0.5, 0.5, (int(rng.integers(3, 8)), 2)) * (1.0, float(rng.choice((1.0, 0.2))))
    return Outline(tuple(map(tuple, corners.round(3).tolist())))


def test_bases_meet_points_at_the_same_time() -> None:
    """Straight on, on arcs and on the spot: points far off, near, and within the outline, and where the way ends."""
    rng, met = np.random.default_rng(7), 0
    for _ in range(5 * CASES):
        base, points = outline(rng), cloud(rng, 1) * float(rng.choice((0.1, 0.3, 1.0)))
        arc = Motion(float(rng.choice((0.0, 0.3, -0.5, 1.0))), float(rng.choice((0.8, -0.3, 3.0, -1e-3, 0.0))))

        def meet(seconds: float, points: np.ndarray = points, base: Outline = base, arc: Motion = arc) -> tuple[float]:
            return (meeting_time(base, arc, seconds, points, 0.1),)

        (first,) = both(partial(meet, 3.0))
        if first < math.inf:
            met += 1
            both(partial(meet, first))
    assert met > CASES


DRIVES = """
import sys
from zteam.bench.steps.scenes import SCENES
from zteam.bench.steps.figures import measure_steps
from zteam.behaviors.jit import BEHAVIOR_KERNELS
from zteam.compiling import kept_kernels, kernels
from zteam.behaviors.kernel_samples import call_kernels

types = {}
original = kernels.Kernel.__call__
def noted(self, *args):
    if self.owner is BEHAVIOR_KERNELS:
        types.setdefault(self.name, set()).add(kept_kernels.types_of(args))
    return original(self, *args)
kernels.Kernel.__call__ = noted
call_kernels()
called = len(types)
figures = list(measure_steps(6.0, 1))
print(all(scene.same for scene in figures), called, len(types))
print(sorted(name for name, found in types.items() if len(found) > 1), "numba" in sys.modules)
print(sorted(kernel.name for kernel in BEHAVIOR_KERNELS.kernels if kernel.name in types and kernel._kept is None))
"""


@pytest.mark.ci
def test_robots_need_no_numba() -> None:
    """In all scenes of `zteam bench steps` a kernel is called with the types of its sample, and runs as it is kept."""
    done = subprocess.run(
        [sys.executable, "-P", "-c", DRIVES], capture_output=True, text=True, timeout=3 * LIMIT, check=False
    )
    assert done.stdout == "True 3 3\n[] False\n[]\n", done.stderr
