"""The robots' kernels give without numba what the compiled ones give, to the last bit."""

import math
import subprocess
import sys
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np
import pytest

from zteam.behaviors.jit import BEHAVIOR_KERNELS
from zteam.behaviors.memory_kernels import add_scan, clear_seen, select_near, select_untold
from zteam.behaviors.safety.sectors import axes_of
from zteam.behaviors.safety.swept import Arc, Outline, meeting_time
from zteam.behaviors.scan_kernels import find_nearest, interpret, select_hits
from zteam.compiling import takeover
from zteam.compiling.kernels import has_numba

pytestmark = pytest.mark.skipif(not has_numba(), reason="numba is not installed")
CASES = 400
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


def distances(rng: np.random.Generator) -> np.ndarray:
    """As they are made of ranges: above 0, inf or NaN."""
    return np.maximum(scan(rng), 1e-6)


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


def test_groups_have_the_same_nearest() -> None:
    """The last group may be smaller, and a group may say nothing at all."""
    rng = np.random.default_rng(2)
    for _ in range(CASES):
        given = distances(rng)
        size = int(rng.integers(2, 9))

        def group(given: np.ndarray = given, size: int = size) -> tuple[Any, ...]:
            nearest = np.empty(-(-given.size // size))
            find_nearest(given, size, nearest)
            return (nearest,)

        both(group)


def test_hits_are_the_same() -> None:
    """Beams that end before the border, beyond it, and just there."""
    rng, most = np.random.default_rng(3), 0
    for _ in range(CASES):
        given = distances(rng)
        ends = np.where(rng.random(given.size) < 0.2, given, rng.uniform(0.0, 32.0, given.size))
        axes = axes_of(-2.0, 0.1, given.size)

        def select(given: np.ndarray = given, ends: np.ndarray = ends, axes: np.ndarray = axes) -> tuple[Any, ...]:
            points = np.empty(axes.shape)
            count = select_hits(given, ends, axes, 0.1, -0.2, points)
            return count, points[:, :count].copy()

        most = max(most, both(select)[0])
    assert most > 20


def frame(rng: np.random.Generator) -> tuple[float, float, float, float]:
    """Anywhere; some look along an axis."""
    yaw = float(rng.choice((0.0, 0.5 * math.pi, math.pi, rng.uniform(-4.0, 4.0))))
    x, y = rng.uniform(-2.0, 2.0, 2).round(2).tolist()
    return x, y, math.cos(yaw), math.sin(yaw)


def cloud(rng: np.random.Generator, least: int = 0) -> np.ndarray:
    """Points; some lie on a lattice."""
    points = rng.uniform(-3.0, 3.0, (2, int(rng.integers(least, 60))))
    return points.round(1) if rng.random() < 0.5 else points


def sectors(rng: np.random.Generator) -> tuple[float, float, np.ndarray]:
    """Of a laser that turns either way, and may look beyond a full circle."""
    known = distances(rng)
    step = float(rng.choice((-1.0, 1.0))) * float(rng.uniform(0.01, 8.0)) / known.size
    return float(rng.uniform(-4.0, 4.0)), step, np.minimum(known, 6.0)


def test_what_a_scan_tells_of_is_the_same() -> None:
    """Points before, at and behind what the beams met, and where no beam looks."""
    rng, counts = np.random.default_rng(4), [0, 0]
    for _ in range(CASES):
        points, at, known = cloud(rng), frame(rng), sectors(rng)

        def select(points: np.ndarray = points, at: Any = at, known: Any = known) -> tuple[Any, ...]:
            untold = np.empty(points.shape)
            count = select_untold(points, *at, *known, untold)
            return count, untold[:, :count].copy()

        counts[0] += both(select)[0]
        counts[1] += points.shape[1]
    assert 0.2 < counts[0] / counts[1] < 0.95


def test_a_scan_changes_the_cloud_in_the_same_way() -> None:
    """Points that are too old go, and those that it tells of; its own come, as far as they are near enough."""
    rng, stayed = np.random.default_rng(5), 0
    for _ in range(CASES):
        points, at, known = cloud(rng), frame(rng), sectors(rng)
        born = rng.uniform(0.0, 5.0, points.shape[1]).round(1)
        axes = axes_of(known[0], known[1], known[2].size)

        def add(
            points: np.ndarray = points, born: np.ndarray = born, at: Any = at, known: Any = known, axes: Any = axes
        ) -> tuple[Any, ...]:
            room = born.size + axes.shape[1]
            found, times = np.empty((2, room)), np.empty(room)
            count = add_scan(points, born, 2.0, 5.5, *at, *known, axes, 4.0, found, times)
            return count, found[:, :count].copy(), times[:count].copy()

        stayed += int((both(add)[2] < 5.5).sum())
    assert stayed > CASES


def test_points_in_a_box_are_the_same() -> None:
    """Points on its border too, and such that are too far away."""
    rng, total = np.random.default_rng(6), 0
    for _ in range(CASES):
        points, at, box = cloud(rng), frame(rng), rng.uniform(0.0, 2.0, 4).round(1).tolist()

        def select(points: np.ndarray = points, at: Any = at, box: Any = box) -> tuple[Any, ...]:
            near = np.empty(points.shape)
            count = select_near(points, *at, -box[0], box[1], -box[2], box[3], 1.5, near)
            return count, near[:, :count].copy()

        total += both(select)[0]
    assert total > CASES


def test_what_was_never_seen_is_the_same() -> None:
    """Places that several scans saw, or one, or a base stood on, or nothing; of these some are known to be seen."""
    rng, counts = np.random.default_rng(8), [0, 0]
    for _ in range(CASES):
        places, (start, step, first) = cloud(rng), sectors(rng)
        scans = [np.minimum(rng.permutation(first), 3.0) for _ in range(int(rng.integers(1, 6)))]
        frames = np.array([(*frame(rng), *frame(rng)) for _ in scans])
        asked = rng.random(places.shape[1]) < 0.8
        known = np.array(scans)

        def clear(
            places: np.ndarray = places, frames: np.ndarray = frames, known: np.ndarray = known,
            asked: np.ndarray = asked, start: float = start, step: float = step,
        ) -> tuple[Any, ...]:  # fmt: skip
            unseen = asked.copy()
            clear_seen(unseen, places, frames, start, step, known, 0.2, 0.1, 0.2)
            return (unseen,)

        counts[0] += int(both(clear)[0].sum())
        counts[1] += int(asked.sum())
    assert 0.1 < counts[0] / counts[1] < 0.9


def outline(rng: np.random.Generator) -> Outline:
    """Three to seven corners; some a little more than a line."""
    corners = rng.uniform(-0.5, 0.5, (int(rng.integers(3, 8)), 2)) * (1.0, float(rng.choice((1.0, 0.2))))
    return Outline(tuple(map(tuple, corners.round(3).tolist())))


def test_bases_meet_points_at_the_same_time() -> None:
    """Straight on, on arcs and on the spot: points far off, near, and within the outline, and where the way ends."""
    rng, met = np.random.default_rng(7), 0
    for _ in range(5 * CASES):
        base, points = outline(rng), cloud(rng, 1) * float(rng.choice((0.1, 0.3, 1.0)))
        arc = Arc(float(rng.choice((0.0, 0.3, -0.5, 1.0))), float(rng.choice((0.8, -0.3, 3.0, -1e-3, 0.0))))

        def meet(seconds: float, points: np.ndarray = points, base: Outline = base, arc: Arc = arc) -> tuple[float]:
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


def test_robots_need_no_numba() -> None:
    """In all scenes of `zteam bench steps` a kernel is called with the types of its sample, and runs as it is kept."""
    done = subprocess.run(
        [sys.executable, "-P", "-c", DRIVES], capture_output=True, text=True, timeout=100, check=False
    )
    assert done.stdout == "True 9 9\n[] False\n[]\n", done.stderr
