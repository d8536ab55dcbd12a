"""Polygons as arrays: in groups that move together, sorted into bins by place."""

import itertools
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from zteam.geometry import Pose2
from zteam.sim.jit import compiled
from zteam.world.model import Obstacle, Robot, Shape

NO_MOVER = -1
"""Owner of a group that stands still."""
_MAX_BINS = 64
"""Bins along x and along y."""
_BIN = 3.0
"""Least size of a bin in metres."""
_FEW = 32
"""Up to so many groups there is one bin."""

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


class Polygons(NamedTuple):
    """All polygons, as arrays for numba. The shapes of one mover form a group; a shape that stands still is a group."""

    local_x: Floats
    """(vertices) in the owner's frame, in `map` for what stands still."""
    local_y: Floats
    x: Floats
    """(vertices) in `map`."""
    y: Floats
    first_vertex: Ints
    """(shapes + 1)"""
    z_min: Floats
    z_max: Floats
    first_shape: Ints
    """(groups + 1)"""
    owner: NDArray[np.int64]
    """(groups): the mover's index, or NO_MOVER."""
    local_centre: Floats
    """(groups, 2)"""
    centre_x: Floats
    centre_y: Floats
    radius: Floats
    """(groups): of the circle about the centre that holds all of the group's shapes."""
    in_bin: Ints
    """(groups): groups in the order of their bins."""
    bin_start: Ints
    """(bins + 2): the bins row by row, then one for the groups that are wider than a bin."""
    bins: Ints
    """Bins along x and along y."""
    bin_x: Floats
    """(1): origin of the bins; numba takes arrays of one as what can change."""
    bin_y: Floats
    bin_size: Floats
    reach: Floats
    """(1): the largest radius of a group in a bin."""


class Group(NamedTuple):
    """Shapes that move together."""

    owner: int
    """The mover that they belong to, or NO_MOVER."""
    source: int
    """The model: robots come first, then all obstacles."""
    shapes: Sequence[Shape]


def group_shapes(robots: Sequence[Robot], obstacles: Sequence[Obstacle]) -> list[Group]:
    """All shapes by owner: robots are movers 0, 1, …; obstacles that can be pushed come after them."""
    groups = [Group(i, i, robot.shapes) for i, robot in enumerate(robots)]
    movers = len(robots)
    for source, obstacle in enumerate(obstacles, len(robots)):
        if obstacle.mass is not None:
            groups.append(Group(movers, source, obstacle.shapes))
            movers += 1
        else:
            groups += [Group(NO_MOVER, source, [place_shape(obstacle.pose, shape)]) for shape in obstacle.shapes]
    return groups


def place_shape(pose: Pose2, shape: Shape) -> Shape:
    """A shape in `map` whose owner stands at `pose`."""
    points = tuple(pose.compose(Pose2(x, y, 0.0))[:2] for x, y in shape.points)
    return Shape(points, shape.z_min, shape.z_max, shape.ranger_return, shape.obstacle, shape.color)


def find_slabs(shapes: Sequence[Shape], most: int) -> list[tuple[float, float]]:
    """Layers between the heights at which what collides begins or ends; the topmost are one if there are too many."""
    heights = sorted({z for shape in shapes if shape.obstacle for z in (shape.z_min, shape.z_max)})
    return list(itertools.pairwise([-math.inf, *heights[: most - 1], math.inf]))


def make_polygons(groups: Sequence[Group]) -> Polygons:
    """Arrays of the groups' shapes; groups without shapes are left out."""
    groups = [group for group in groups if group.shapes]
    shapes = [shape for group in groups for shape in group.shapes]
    points = np.array([point for shape in shapes for point in shape.points], float).reshape(-1, 2)
    centres, radii = [], []
    for group in groups:
        corners = np.array([point for shape in group.shapes for point in shape.points], float)
        centre = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
        centres.append(centre)
        radii.append(float(np.hypot(*(corners - centre).T).max()))
    local_centre = np.array(centres, float).reshape(-1, 2)
    polygons = Polygons(
        local_x=points[:, 0].copy(),
        local_y=points[:, 1].copy(),
        x=points[:, 0].copy(),
        y=points[:, 1].copy(),
        first_vertex=_starts([len(shape.points) for shape in shapes]),
        z_min=np.array([shape.z_min for shape in shapes], float),
        z_max=np.array([shape.z_max for shape in shapes], float),
        first_shape=_starts([len(group.shapes) for group in groups]),
        owner=np.array([group.owner for group in groups], np.int64),
        local_centre=local_centre,
        centre_x=local_centre[:, 0].copy(),
        centre_y=local_centre[:, 1].copy(),
        radius=np.array(radii, float),
        in_bin=np.arange(len(groups), dtype=np.int32),
        bin_start=np.zeros(_MAX_BINS * _MAX_BINS + 2, np.int32),
        bins=np.ones(2, np.int32),
        bin_x=np.zeros(1),
        bin_y=np.zeros(1),
        bin_size=np.ones(1),
        reach=np.zeros(1),
    )
    sort_into_bins(polygons)
    return polygons


def _starts(counts: Sequence[int]) -> Ints:
    return np.concatenate(([0], np.cumsum(counts, dtype=np.int32))).astype(np.int32)


@compiled
def move_polygons(o: Polygons, poses: Floats) -> None:
    """Bring the groups of movers to `poses` (movers; x, y, yaw in `map`)."""
    for group in range(o.owner.shape[0]):
        mover = o.owner[group]
        if mover < 0:
            continue
        x, y = poses[mover, 0], poses[mover, 1]
        cos, sin = math.cos(poses[mover, 2]), math.sin(poses[mover, 2])
        u, v = o.local_centre[group, 0], o.local_centre[group, 1]
        o.centre_x[group], o.centre_y[group] = x + cos * u - sin * v, y + sin * u + cos * v
        begin, end = o.first_vertex[o.first_shape[group]], o.first_vertex[o.first_shape[group + 1]]
        for i in range(begin, end):
            u, v = o.local_x[i], o.local_y[i]
            o.x[i], o.y[i] = x + cos * u - sin * v, y + sin * u + cos * v
    sort_into_bins(o)


@compiled
def sort_into_bins(o: Polygons) -> None:
    """Sort the groups by the bin of their centre: a counting sort, so groups of one bin stay in order."""
    groups = o.owner.shape[0]
    o.bins[0] = o.bins[1] = 1
    o.bin_size[0] = 1e12
    if groups > _FEW:
        low_x, high_x = o.centre_x.min(), o.centre_x.max()
        low_y, high_y = o.centre_y.min(), o.centre_y.max()
        size = max(_BIN, max(high_x - low_x, high_y - low_y) / _MAX_BINS)
        o.bin_x[0], o.bin_y[0], o.bin_size[0] = low_x, low_y, size
        o.bins[0] = min(_MAX_BINS, int((high_x - low_x) / size) + 1)
        o.bins[1] = min(_MAX_BINS, int((high_y - low_y) / size) + 1)
    count = o.bins[0] * o.bins[1] + 1
    o.bin_start[: count + 1] = 0
    o.reach[0] = 0.0
    for group in range(groups):
        place = _bin_of(o, group)
        o.bin_start[place + 1] += 1
        if place < count - 1:
            o.reach[0] = max(o.reach[0], o.radius[group])
    for i in range(count):
        o.bin_start[i + 1] += o.bin_start[i]
    for group in range(groups):
        place = _bin_of(o, group)
        o.in_bin[o.bin_start[place]] = group
        o.bin_start[place] += 1
    for i in range(count, 0, -1):
        o.bin_start[i] = o.bin_start[i - 1]
    o.bin_start[0] = 0


@compiled
def _bin_of(o: Polygons, group: int) -> int:
    if o.radius[group] > o.bin_size[0]:
        return int(o.bins[0] * o.bins[1])
    return bin_at(o, o.centre_y[group], o.bin_y[0], 1) * int(o.bins[0]) + bin_at(o, o.centre_x[group], o.bin_x[0], 0)


@compiled
def bin_at(o: Polygons, value: float, origin: float, axis: int) -> int:
    """Row (axis 1) or column (axis 0) of the bin nearest to a coordinate."""
    place: int = math.floor((value - origin) / o.bin_size[0])
    return min(max(place, 0), int(o.bins[axis]) - 1)


@compiled
def contains(px: Floats, py: Floats, begin: int, end: int, x: float, y: float) -> bool:
    """Whether a point lies in the polygon of vertices `begin` to `end`, by the even-odd rule."""
    inside = False
    j = end - 1
    for i in range(begin, end):
        if (py[i] > y) != (py[j] > y) and x < px[i] + (y - py[i]) * (px[j] - px[i]) / (py[j] - py[i]):
            inside = not inside
        j = i
    return inside
