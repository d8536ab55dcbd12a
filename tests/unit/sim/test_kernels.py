"""Kernels without numba give what the compiled ones give, to the last bit.

ZTEAM_KERNEL_RAYS in the environment is the number of rays that are compared in each test, such as 10000000.
"""

import math
import os

import numpy as np
import pytest

from support.examples import SHARE
from support.small_worlds import plain_kernels
from zteam.geometry import Pose2
from zteam.sim import edge_kernels, jit, square_kernels
from zteam.sim.fields import build_fields
from zteam.sim.polygons import NO_MOVER, Group, make_polygons, place_shape
from zteam.world.model import Shape

RAYS = int(os.environ.get("ZTEAM_KERNEL_RAYS", 200_000 * SHARE))
SCANS, BEAMS = 50, 721
EIGHTH = math.pi / 4
WALL = Shape(((9.0, -15.0), (9.1, -15.0), (9.1, 15.0), (9.0, 15.0)), 0.0, 1.0)
"""Far off, as a world's border is."""
CORNERS = [Pose2(3.0, 3.0, i * EIGHTH) for i in range(0, 8, 2)]
Scans = tuple[np.ndarray, np.ndarray, np.ndarray]


@pytest.fixture(autouse=True)
def _compiled() -> None:
    jit.use_compiled()


def beams(rng: np.random.Generator) -> tuple[float, float, np.ndarray]:
    """First angle, increment, and all angles; half of the time multiples of 45 degrees are among them."""
    increment = math.radians(0.5 if rng.random() < 0.5 else 0.375)
    return -increment * (BEAMS // 2), increment, increment * (np.arange(BEAMS) - BEAMS // 2)


def places(rng: np.random.Generator, cell: float, size: float, on_lattice: bool) -> Scans:
    """Starts in and about a square of `size` metres: anywhere, or on borders, corners and middles of cells."""
    x, y = rng.uniform(-1.0, size + 1.0, (2, SCANS))
    yaw = rng.uniform(-7.0, 7.0, SCANS)
    if on_lattice:
        x, y = np.round(x / cell * 2.0) * cell * 0.5, np.round(y / cell) * cell
        yaw = rng.integers(-8, 9, SCANS) * EIGHTH
    return x, y, yaw


def scan_squares(occupied: np.ndarray, at: Scans, angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Ranges and hits in a bitmap of 0.1 m, with its fields built the same way."""
    fields = build_fields(occupied)
    table = np.cos(angles)[None, :], np.sin(angles)[None, :]
    ranges, hit = np.full((SCANS, BEAMS), 8.0), np.zeros((SCANS, BEAMS), np.int32)
    seen = np.arange(SCANS) % 7 != 0
    square_kernels.cast_squares(
        fields.sides, fields.rows, fields.columns, 0.1, 0.1, *at, seen, *table, 8.0, 3, ranges, hit
    )
    return ranges, hit


def test_rays_against_bitmaps_are_equal() -> None:
    """Starts on cells' borders and corners, along walls and diagonals among them."""
    rng = np.random.default_rng(1)
    for number in range(math.ceil(RAYS / (SCANS * BEAMS))):
        occupied = rng.random((60, 60)) < rng.uniform(0.005, 0.2)
        at, (_, _, angles) = places(rng, 0.1, 6.0, number % 2 == 0), beams(rng)
        compiled = scan_squares(occupied, at, angles)
        with plain_kernels():
            plain = scan_squares(occupied, at, angles)
        for one, other in zip(compiled, plain, strict=True):
            assert one.tobytes() == other.tobytes(), number


def random_groups(rng: np.random.Generator, on_lattice: bool) -> list[Group]:
    """Boxes and triangles; on a lattice their sides and corners coincide often."""
    groups = []
    for i in range(int(rng.integers(1, 50))):
        width, height = rng.integers(1, 8, 2) * 0.1 if on_lattice else rng.uniform(0.05, 1.5, 2)
        x, y = rng.integers(0, 61, 2) * 0.1 if on_lattice else rng.uniform(0.0, 6.0, 2)
        yaw = int(rng.integers(0, 8)) * EIGHTH if on_lattice else rng.uniform(-4.0, 4.0)
        points = ((0.0, 0.0), (width, 0.0), (width, height), (0.0, height))[: int(rng.integers(3, 5))]
        groups.append(Group(NO_MOVER, i, [place_shape(Pose2(float(x), float(y), yaw), Shape(points, 0.0, 1.0))]))
    return groups


def test_rays_against_edges_are_equal() -> None:
    """Rays along edges, through corners and from them among them; of two equally near shapes both take the same."""
    rng = np.random.default_rng(2)
    for number in range(math.ceil(RAYS / (SCANS * BEAMS))):
        polygons = make_polygons(random_groups(rng, number % 2 == 0))
        x, y, yaw = places(rng, 0.1, 6.0, number % 2 == 0)
        if number % 3 == 0:
            # Every scan's middle beam goes for a corner.
            aim = rng.integers(0, len(polygons.x), SCANS)
            yaw = np.arctan2(polygons.y[aim] - y, polygons.x[aim] - x)
        angle_min, increment, angles = beams(rng)
        table = np.cos(angles)[None, :], np.sin(angles)[None, :]
        results = []
        for mode in (jit.use_compiled, jit.use_plain):
            mode()
            ranges, hit = np.full((SCANS, BEAMS), 8.0), np.full((SCANS, BEAMS), -1, np.int32)
            edge_kernels.cast_edges(
                polygons, x, y, np.full(SCANS, 0.5), yaw, np.full(SCANS, NO_MOVER, np.int64), *table,
                angle_min, increment, 0.0, ranges, hit,
            )  # fmt: skip
            results.append((ranges, hit))
        for one, other in zip(*results, strict=True):
            assert one.tobytes() == other.tobytes(), number


def cast_past(groups: list[Group], at: Scans, fan: tuple[float, float, np.ndarray], ranges: np.ndarray) -> None:
    """Shorten ranges to these groups."""
    (x, y, yaw), (angle_min, increment, angles) = at, fan
    table = np.cos(angles)[None, :], np.sin(angles)[None, :]
    place = x, y, np.full(len(x), 0.5), yaw, np.full(len(x), NO_MOVER, np.int64)
    hit = np.zeros(ranges.shape, np.int32)
    edge_kernels.cast_edges(make_polygons(groups), *place, *table, angle_min, increment, 0.0, ranges, hit)


def test_edges_behind_what_beams_have_met_change_nothing() -> None:
    """Only these are skipped: a wall a hand nearer than the last one still shortens its ranges, whatever the order."""
    rng = np.random.default_rng(5)
    for number in range(20):
        walls = [
            [Group(NO_MOVER, 0, [place_shape(corner.compose(Pose2(away, 0.0, 0.0)), WALL)]) for corner in CORNERS]
            for away in (0.2, 0.1, 0.0)
        ]
        x, y, yaw = (values[:6] for values in places(rng, 0.1, 6.0, number % 2 == 0))
        at, fan = (x, y, yaw), beams(rng)
        outward, inward = np.full((2, 6, BEAMS), 30.0)
        for groups in walls:
            cast_past(groups, at, fan, outward)
        for groups in reversed(walls):
            cast_past(groups, at, fan, inward)
        assert outward.tobytes() == inward.tobytes(), number
        assert outward.max() < 30.0
