"""The simulator's kernels against plain references, on what is drawn: rays, overlaps, ways of bases."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from support.examples import examples
from support.ray_references import Point, cast_at_cells, cast_at_polygons, common_area, is_on_border
from zteam.geometry import Pose2
from zteam.kernels import binding, simulator
from zteam.kernels.simulator import (
    Bases,
    BeamTable,
    Bitmaps,
    Fans,
    Polygons,
    Rays,
    build_fields,
    cast_edges,
    cast_squares,
    find_overlaps,
    follow,
)
from zteam.simulator.core.casting import NO_MOVER, Group, make_polygons, place_shape
from zteam.simulator.world.model import Shape

LIMIT = 9.0
EIGHTH = math.pi / 4

seeds = st.integers(0, 2**32 - 1)
# Axis-aligned and diagonal rays among them.
cells = st.sampled_from([(0.2, 0.2), (0.15, 0.23)])
angles = st.one_of(st.floats(-math.pi, math.pi), st.sampled_from([i * EIGHTH for i in range(-4, 5)]))
odd = st.sampled_from([math.nan, math.inf, -math.inf, 1e300, -1e300, 1e18, 0.0])


def bitmap(seed: int, rows: int = 13, columns: int = 17, most: float = 0.3) -> np.ndarray:
    """Some cells are occupied."""
    rng = np.random.default_rng(seed)
    return rng.random((rows, columns)) < rng.uniform(0.02, most)


def maps_of(occupied: np.ndarray, cell: tuple[float, float], pose: Pose2 | None = None) -> Bitmaps:
    """A bitmap from the ground up to 1 m."""
    return Bitmaps([(build_fields(occupied), *occupied.shape, *cell, *(pose or Pose2(0.0, 0.0, 0.0)), 0.0, 1.0)])


def fan_of(poses: Any, beams: np.ndarray, increment: float = 0.0, limit: float = LIMIT, z: float = 0.5) -> Fans:
    """Fans from these poses (n; x, y, yaw), nothing met yet."""
    at = np.array(poses, float).reshape(-1, 3).T.copy()
    count = at.shape[1]
    rays = Rays(at, np.full(count, z), np.full(count, NO_MOVER, np.int64))
    first = float(beams[0]) if beams.size else 0.0
    fans = Fans(rays, BeamTable(np.cos(beams)[None, :], np.sin(beams)[None, :], first, increment, limit))
    fans.ranges.fill(limit)
    fans.hits.fill(-1)
    return fans


@given(
    seeds.map(bitmap), st.floats(-1.0, 4.0), st.floats(-1.0, 4.0), angles, st.sampled_from([(0.2, 0.2), (0.15, 0.23)])
)
@examples(300)
def test_rays_at_bitmaps_are_exact(
    occupied: np.ndarray, x: float, y: float, yaw: float, cell: tuple[float, float]
) -> None:
    """They agree with a slab test against every cell, also for starts outside and unequal cells."""
    # Off the lattice: from a cell's very corner, which of two touching cells a ray meets is a matter of taste.
    x, y = x + 0.0123456789, y + 0.0234567891
    column, row = math.floor(x / cell[0]), math.floor(y / cell[1])
    assume(not (0 <= row < 13 and 0 <= column < 17 and occupied[row, column]))
    beams = np.array([0.0, 0.3, -1.1, math.pi / 2])
    fans = fan_of((x, y, yaw), beams)
    cast_squares(maps_of(occupied, cell), fans, 7)
    assert ((fans.hits == 7) == (fans.ranges < LIMIT)).all()
    for beam, ours in zip(beams, fans.ranges[0], strict=True):
        # A ray through the corner of a cell may be said to touch it or not; a hair beside it decides the same way.
        near = [cast_at_cells(occupied, cell, x, y, yaw + beam + turn, LIMIT) for turn in (0.0, -1e-7, 1e-7)]
        assert min(abs(ours - expected) for expected in near) <= 1e-5


@given(seeds, st.booleans())
@examples(30)
def test_every_build_of_the_bitmap_kernel_gives_the_same_bytes(seed: int, on_lattice: bool) -> None:
    """The one for each processor and the one for AVX2."""
    rng = np.random.default_rng(seed)
    maps = maps_of(bitmap(seed, 60, 70, 0.1), (0.1, 0.1), Pose2(-1.0, 2.0, rng.uniform(-3.0, 3.0)))
    poses = rng.uniform(-8.0, 8.0, (20, 3))
    if on_lattice:
        maps, poses = maps_of(bitmap(seed, 60, 70, 0.1), (0.1, 0.1)), np.round(poses * 20.0) / 20.0
        poses[:, 2] = rng.integers(-8, 9, 20) * EIGHTH
    fans = [fan_of(poses, np.linspace(-2.0, 2.0, 361)) for _ in range(2)]
    binding.lib.cast_squares(maps.data, fans[0].data, 1)
    if binding.lib.has_avx2():
        binding.lib.cast_squares_avx2(maps.data, fans[1].data, 1)
        assert fans[0].ranges.tobytes() == fans[1].ranges.tobytes()
        assert fans[0].hits.tobytes() == fans[1].hits.tobytes()


def random_groups(rng: np.random.Generator, on_lattice: bool) -> list[Group]:
    """Boxes and triangles that stand still; on a lattice their sides and corners coincide often."""
    groups = []
    for i in range(int(rng.integers(1, 50))):
        width, height = rng.integers(1, 8, 2) * 0.1 if on_lattice else rng.uniform(0.05, 1.5, 2)
        x, y = rng.integers(0, 61, 2) * 0.1 if on_lattice else rng.uniform(0.0, 6.0, 2)
        yaw = int(rng.integers(0, 8)) * EIGHTH if on_lattice else rng.uniform(-4.0, 4.0)
        points = ((0.0, 0.0), (width, 0.0), (width, height), (0.0, height))[: int(rng.integers(3, 5))]
        groups.append(Group(NO_MOVER, i, [place_shape(Pose2(float(x), float(y), yaw), Shape(points, 0.0, 1.0))]))
    return groups


@given(seeds, st.booleans(), st.sampled_from([0.5, 0.375, 0.99]))
@examples(60)
def test_rays_at_polygons_are_exact(seed: int, on_lattice: bool, degrees: float) -> None:
    """To the bit what every beam against every edge gives: rays along edges and through corners among them."""
    rng = np.random.default_rng(seed)
    groups, increment = random_groups(rng, on_lattice), math.radians(degrees)
    shapes = [list(shape.points) for group in groups for shape in group.shapes]
    poses = rng.uniform(-1.0, 7.0, (5, 3))
    if on_lattice:
        poses = np.column_stack((np.round(poses[:, :2] * 20.0) / 20.0, rng.integers(-8, 9, 5) * EIGHTH))
    # One goes for a corner.
    corner = shapes[0][0]
    poses[0, 2] = math.atan2(corner[1] - poses[0, 1], corner[0] - poses[0, 0])
    beams = increment * np.arange(-180, 181)
    fans = fan_of(poses, beams, increment)
    cast_edges(make_polygons(groups), fans)
    for pose, ranges, hits in zip(poses.tolist(), fans.ranges, fans.hits, strict=True):
        if any(is_on_border(points, *pose[:2]) for points in shapes):
            continue

        def cast(polygons: list[list[Point]], at: Any = pose) -> np.ndarray:
            table = np.cos(beams), np.sin(beams)
            return np.stack([cast_at_polygons(polygons, at, *table, LIMIT, fronts=fronts) for fronts in (True, False)])

        assert (ranges == cast(shapes)).any(axis=0).all()
        assert ((hits >= 0) == (ranges < LIMIT)).all()
        for shape in np.unique(hits[hits >= 0]).tolist():
            assert (ranges == cast([shapes[shape]])).any(axis=0)[hits == shape].all()


@given(st.tuples(odd, odd, odd), st.sampled_from([0, 1, 2, 63, 64, 65, 1000]), st.booleans())
@examples(150)
def test_odd_poses_and_sizes_of_fans_are_defined(pose: tuple[float, float, float], width: int, some: bool) -> None:
    """A sensor at no place sees nothing; one far off, and fans of any width, write nothing but their own ranges."""
    fans = fan_of([(0.3, 0.4, 0.5), pose] if some else [], np.linspace(-1.0, 1.0, width), 2.0 / max(1, width - 1))
    polygons = make_polygons(random_groups(np.random.default_rng(1), False))
    polygons.move(np.empty((0, 3)))
    cast_squares(maps_of(bitmap(3), (0.2, 0.2), Pose2(*pose)), fans, 1)
    cast_squares(maps_of(bitmap(3), (0.2, 0.2)), fans, 1)
    cast_edges(polygons, fans)
    assert ((fans.ranges >= 0.0) & (fans.ranges <= LIMIT)).all()
    if some and not np.isfinite(pose).all():
        assert (fans.ranges[1] == LIMIT).all()


def boxes_of(rng: np.random.Generator, count: int) -> tuple[Polygons, np.ndarray, list[list[Point]]]:
    """Movers of one convex shape each, some far from their middle, their poses, and their corners there."""
    groups, poses, corners = [], rng.uniform(0.0, 6.0, (count, 3)), []
    for i in range(count):
        w, h = rng.uniform(0.1, 1.0, 2)
        arm = float(rng.choice((0.0, 2.0)))
        points = ((arm, 0.0), (arm + w, 0.0), (arm + w, h), (arm, h))[: int(rng.integers(3, 5))]
        groups.append(Group(i, i, [Shape(points, 0.0, 1.0)]))
        corners.append([Pose2(*poses[i].tolist()).compose(Pose2(u, v, 0.0))[:2] for u, v in points])
    return make_polygons(groups), poses, corners


@given(seeds, st.sampled_from([3, 12, 60]))
@examples(60)
def test_what_overlaps_shares_an_area(seed: int, count: int) -> None:
    """Movers overlap each other, or a bitmap's cell, where their polygons share an area, in whatever bins they are."""
    rng = np.random.default_rng(seed)
    polygons, poses, corners = boxes_of(rng, count)
    polygons.move(poses)
    occupied, found = bitmap(seed, 20, 20, 0.05), np.zeros(count, bool)
    for apart, others in ((True, corners), (False, [])):
        find_overlaps(polygons, Bitmaps([]), apart, found)
        for i, mine in enumerate(corners):
            areas = [common_area(mine, other) for other in others if other is not mine]
            # What is as small as this may be a touch.
            assert found[i] == (max(areas, default=0.0) > 0.0) or 0.0 < max(areas, default=0.0) < 1e-7
    find_overlaps(polygons, maps_of(occupied, (0.3, 0.3)), False, found)
    cells = [(0.3 * column, 0.3 * row) for row, column in np.argwhere(occupied).tolist()]
    squares: list[list[Point]] = [[(x, y), (x + 0.3, y), (x + 0.3, y + 0.3), (x, y + 0.3)] for x, y in cells]
    for i, mine in enumerate(corners):
        most = max((common_area(mine, square) for square in squares), default=0.0)
        assert found[i] == (most > 0.0) or 0.0 < most < 1e-7


@given(st.lists(st.tuples(odd, odd, odd), min_size=1, max_size=40))
@examples(60)
def test_movers_at_odd_places_overlap_nothing_that_is_somewhere(poses: list[tuple[float, float, float]]) -> None:
    """Whatever the poses hold, kernels end, and a mover that is nowhere meets no cell."""
    groups = [Group(i, i, [Shape(((0.0, 0.0), (0.4, 0.0), (0.4, 0.4)), 0.0, 1.0)]) for i in range(len(poses))]
    polygons, found = make_polygons(groups), np.zeros(len(poses), bool)
    polygons.move(np.array(poses))
    find_overlaps(polygons, maps_of(np.ones((9, 9), bool), (0.3, 0.3)), False, found)
    assert not found[~np.isfinite(poses).all(axis=1)].any()
    ends, blocked = np.array(poses)[::-1].copy(), np.zeros(len(poses), bool)
    suspects = np.ones(len(poses), bool)
    simulator.hold(polygons, Bitmaps([]), np.full(len(poses), 0.1), np.array(poses), ends, suspects, ~suspects, True)
    simulator.move_all(polygons, Bitmaps([]), np.array(poses), ends, blocked)


speeds = st.tuples(st.floats(-2.0, 2.0), st.floats(-1.0, 1.0), st.floats(-3.0, 3.0))
commands = st.tuples(speeds, st.booleans())
places = st.tuples(st.floats(-50.0, 50.0), st.floats(-50.0, 50.0), st.floats(-20.0, 20.0))


def bases_of(start: np.ndarray, *, car: bool = False, fast: float = math.inf) -> Bases:
    """Bases with two wheels each; at most 1 m/s and 1 rad/s."""
    count = len(start)
    limits = np.empty((4, count, 3))
    limits[0], limits[1], limits[2], limits[3] = -1.0, 1.0, -fast, fast
    owner = np.repeat(np.arange(count), 2)
    rows = np.tile(((5.0, 0.0, -1.0), (5.0, 0.0, 1.0)), (count, 1))
    return Bases(limits, np.full(count, car), np.full(count, 0.5), start, owner, rows)


@given(places, speeds, st.booleans(), st.sampled_from([0.02, 0.1]))
@examples(200)
def test_bases_notice_the_velocity_that_they_followed(
    place: tuple[float, float, float], speed: tuple[float, float, float], tangents: bool, seconds: float
) -> None:
    """On arcs and on Stage's steps; odometry is the way seen from the start, and wheels turn by what the base did."""
    start, velocity = np.array([place]), np.array([speed])
    bases, ends = bases_of(start), follow(start, velocity, seconds, tangents=tangents)
    bases.note_motion(start, ends, seconds, tangents=tangents)
    assert bases.velocity[0] == pytest.approx(speed, abs=1e-9)
    seen = Pose2(*place).inverse().compose(Pose2(*ends[0].tolist()))
    assert bases.odom[0, :2] == pytest.approx(seen[:2], abs=1e-9)
    assert bases.odom[0, 2] == ends[0, 2] - place[2]
    assert bases.rates == pytest.approx([5.0 * speed[0] - speed[2], 5.0 * speed[0] + speed[2]], abs=1e-8)
    assert bases.angles == pytest.approx(bases.rates * seconds)


@given(
    st.lists(st.tuples(speeds, st.booleans()), min_size=1, max_size=12), st.booleans(), st.sampled_from([0.8, math.inf])
)
@examples(200)
def test_bases_obey_within_their_limits(
    told: list[tuple[tuple[float, float, float], bool]], car: bool, fast: float
) -> None:
    """Speeds reach what is commanded as soon as the limits allow; a stale command is 0; a car's wheels do not jump."""
    bases = bases_of(np.zeros((1, 3)), car=car, fast=fast)
    for command, fresh in told:
        before = bases.setpoint[0].tolist()
        bases.obey(np.array([command]), np.array([fresh]), 0.1)
        v, w = (command[0] * math.cos(command[2]), command[0] * math.sin(command[2]) / 0.5) if car else command[::2]
        for axis, wish in ((0, v), (1, command[1]), (2, w)):
            goal = min(1.0, max(-1.0, wish)) if fresh else 0.0
            reached = min(max(goal, before[axis] - 0.1 * fast), before[axis] + 0.1 * fast)
            if car and axis == 2:
                assert abs(bases.setpoint[0, 2]) <= abs(reached) + 1e-12
            else:
                assert bases.setpoint[0, axis] == pytest.approx(reached, abs=1e-12)


def test_calls_with_what_does_not_fit_are_refused() -> None:
    """Indexes, shapes without vertices, too few poses, arrays of another type or order or read only, parked bits."""
    triangle = [(((0.0, 0.0), (1.0, 0.0), (0.0, 1.0)), 0.0, 1.0)]
    for groups, named in (([(-2, triangle)], "owner"), ([(0, [])], "groups"), ([(0, [((), 0.0, 1.0)])], "groups")):
        with pytest.raises(ValueError, match=named):
            Polygons(groups)
    polygons = Polygons([(0, triangle)])
    fans, fields = fan_of((0.0, 0.0, 0.0), np.zeros(3)), build_fields(np.zeros((3, 3), bool))
    with pytest.raises(ValueError, match="0 are too few for 1 movers"):
        polygons.move(np.empty((0, 3)))
    with pytest.raises(ValueError, match="owner"):
        fans.place(np.zeros((2, 3)))
    with pytest.raises(TypeError, match="double"):
        polygons.move(np.zeros((2, 3), np.float32))
    with pytest.raises(ValueError, match="poses: "):
        polygons.move(np.zeros((2, 6))[:, ::2])
    fields[:, -1] = 1
    with pytest.raises(ValueError, match="parked"):
        Bitmaps([(fields, 3, 3, 0.1, 0.1, 0.0, 0.0, 0.0, 0.0, 1.0)])
    ends = np.zeros((1, 3))
    ends.flags.writeable = False
    some = np.ones(1, bool)
    with pytest.raises(ValueError, match=r"ends: .*read-only"):
        simulator.hold(polygons, Bitmaps([]), np.ones(1), np.zeros((1, 3)), ends, some, some, True)
