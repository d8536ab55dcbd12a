"""The compiled laser kernel for polygons, by their edges; and what makes of its ranges those that are sent.

Method and figures: docs/benchmarks.md. `cos` and `sin` (tables, beams) are the beams' directions in the sensor's frame,
one row for all scans or one for each.
"""

import math

import numpy as np
from numpy.typing import NDArray

from zteam.sim import numpy_kernels
from zteam.sim.jit import compiled, plainly, vectorized
from zteam.sim.polygons import NO_MOVER, Polygons, bin_at, contains

_EDGE = 1e-12
"""Edges reach this far beyond their ends, so that no ray slips through a corner."""
_ROUGH = 4e-5
"""Radians that the difference of two rough bearings may be off."""
_WIDE = 1e-6
"""Metres by which a single ray must miss a disc for the disc to be skipped."""
_SECTOR = numpy_kernels.SECTOR

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


@compiled
def _bearing(y: float, x: float) -> float:
    """atan2 to within _ROUGH, many times faster; it only chooses the beams that are then tested exactly.

    Hastings' polynomial for the arc tangent (Abramowitz and Stegun 1964, 4.4.49).
    """
    far, near = max(abs(x), abs(y)), min(abs(x), abs(y))
    z = near / far if far > 0.0 else 0.0
    s = z * z
    angle = z * (0.9998660 + s * (-0.3302995 + s * (0.1801410 + s * (-0.0851330 + s * 0.0208351))))
    angle = 0.5 * math.pi - angle if abs(y) > abs(x) else angle
    angle = math.pi - angle if x < 0.0 else angle
    return -angle if y < 0.0 else angle


@compiled
def _after(angle: float, start: float) -> float:
    """The angle from `start` on to `angle`, 0 to 2 pi."""
    turn = (angle - start) * (0.5 / math.pi)
    return (turn - math.floor(turn)) * (2.0 * math.pi)


@compiled
def _beams_between(
    start: float, width: float, increment: float, slack: float, beams: int, turn: int
) -> tuple[int, int]:
    """First and end beam from `start` (radians after the first beam, 0 to 2 pi, less 2 pi with `turn` 1) on."""
    if increment == 0.0:
        return 0, 1 - turn
    low = start - turn * 2.0 * math.pi
    begin = math.ceil(low / increment - slack)
    end = math.floor((low + width) / increment + slack) + 1
    return max(0, begin), min(beams, end)


@compiled
def _is_hidden(
    distance: float, bearing: float, radius: float, angle_min: float, increment: float, slack: float, beams: int,
    tops: Floats,
) -> bool:  # fmt: skip
    """Whether a disc lies behind all that the beams towards it have met, or between no beams."""
    sine = radius / distance
    half = sine + (0.5 * math.pi - 1.0) * sine * sine * sine  # no less than the arc sine
    start = _after(bearing - half, angle_min)
    for turn in range(2):
        begin, end = _beams_between(start, 2.0 * half, increment, slack, beams, turn)
        if begin < end:
            for sector in range(begin // _SECTOR, (end - 1) // _SECTOR + 1):
                if tops[sector] > distance - radius:
                    return False
    return True


@plainly(numpy_kernels.find_tops)
@vectorized
def find_tops(ranges: Floats, tops: Floats) -> float:
    """The longest range of every sector, and of all."""
    farthest, whole = 0.0, ranges.shape[0] // _SECTOR
    for sector in range(whole):
        top = 0.0
        for i in range(_SECTOR):
            beam = sector * _SECTOR + i
            top = ranges[beam] if ranges[beam] > top else top
        tops[sector] = top
        farthest = max(farthest, top)
    for beam in range(whole * _SECTOR, ranges.shape[0]):
        tops[whole] = ranges[beam] if beam == whole * _SECTOR else max(tops[whole], ranges[beam])
        farthest = max(farthest, tops[whole])
    return farthest


@plainly(numpy_kernels.cast_edge)
@compiled
def cast_edge(
    ux: float, uy: float, ex: float, ey: float, cos: Floats, sin: Floats, begin: int, end: int, shape: int,
    ranges: Floats, hit: Ints,
) -> None:  # fmt: skip
    """Shorten the ranges of the beams from `begin` to `end` to the edge from u by e, in the sensor's frame."""
    cross = ux * ey - uy * ex
    for beam in range(begin, end):
        denominator = cos[beam] * ey - sin[beam] * ex
        if abs(denominator) < 1e-15:
            continue
        along = cross / denominator
        where = (sin[beam] * ux - cos[beam] * uy) / denominator
        if 0.0 <= along < ranges[beam] and -_EDGE <= where <= 1.0 + _EDGE:
            ranges[beam] = along
            hit[beam] = shape


@compiled
def _next_run(tops: Floats, near: float, begin: int, end: int) -> tuple[int, bool]:
    """The end of the sectors from beam `begin` on that reach as far as `near`, or that do not; and which they do."""
    reaches, stop = tops[begin // _SECTOR] >= near, begin
    while stop < end and (tops[stop // _SECTOR] >= near) == reaches:
        stop = min(end, (stop // _SECTOR + 1) * _SECTOR)
    return stop, reaches


@compiled
def _cast_shape(
    o: Polygons, shape: int, px: float, py: float, yaw: float, cos: Floats, sin: Floats,
    angle_min: float, increment: float, slack: float, outside: bool, far: float, tops: Floats, ranges: Floats,
    hit: Ints,
) -> None:  # fmt: skip
    """Shorten one scan's ranges to one polygon, to 0 in its interior; if the sensor is certainly `outside`, only edges
    that face it are met first."""
    beams = cos.shape[0]
    if not outside and contains(o.x, o.y, o.first_vertex[shape], o.first_vertex[shape + 1], px, py):
        for beam in range(beams):
            if ranges[beam] > 0.0:
                ranges[beam] = 0.0
                hit[beam] = shape
        return
    c0, s0 = math.cos(yaw), math.sin(yaw)
    last = o.first_vertex[shape + 1] - 1
    dx, dy = o.x[last] - px, o.y[last] - py
    ux, uy = c0 * dx + s0 * dy, c0 * dy - s0 * dx
    for vertex in range(o.first_vertex[shape], o.first_vertex[shape + 1]):
        # The edge from u to w, in the sensor's frame.
        dx, dy = o.x[vertex] - px, o.y[vertex] - py
        wx, wy = c0 * dx + s0 * dy, c0 * dy - s0 * dx
        ex, ey = wx - ux, wy - uy
        cross = ux * ey - uy * ex
        # No point of the edge is nearer than the line through it; less what rounding may be worth.
        near = (1.0 - 1e-9) * abs(cross) / math.sqrt(ex * ex + ey * ey) if cross != 0.0 else 0.0
        if (cross < 0.0 or not outside) and near <= far:
            # Counter-clockwise polygons show their edges clockwise.
            right, left = (_bearing(wy, wx), _bearing(uy, ux)) if cross < 0.0 else (_bearing(uy, ux), _bearing(wy, wx))
            start, width = _after(right, angle_min), _after(left, right)
            # An edge seen end on may come out as a full turn for want of digits.
            width = 0.0 if width > 1.5 * math.pi else width
            for turn in range(2):
                begin, end = _beams_between(start, width, increment, slack, beams, turn)
                while begin < end:
                    stop, reaches = _next_run(tops, near, begin, end)
                    if reaches:
                        cast_edge(ux, uy, ex, ey, cos, sin, begin, stop, shape, ranges, hit)
                    begin = stop
        ux, uy = wx, wy


@compiled
def cast_edges(
    o: Polygons, x: Floats, y: Floats, z: Floats, yaw: Floats, sensor_owner: NDArray[np.int64],
    cos: Floats, sin: Floats, angle_min: float, increment: float, jitter: float, ranges: Floats, hit: Ints,
) -> None:  # fmt: skip
    """Shorten `ranges` (scans, beams) to polygons; `hit` becomes the index of the shape where one is nearer.

    Poses are in `map`. A sensor does not see shapes of its own `owner`, nor those that its height `z` misses. Beams
    may be `jitter` increments away from where their number says.
    """
    beams = cos.shape[1]
    slack = jitter + 1e-6 + (_ROUGH / increment if increment > 0.0 else 0.0)
    tops = np.zeros((beams + _SECTOR - 1) // _SECTOR)
    for scan in range(x.shape[0]):
        table = scan if cos.shape[0] > 1 else 0
        row_cos, row_sin, row_ranges, row_hit = cos[table], sin[table], ranges[scan], hit[scan]
        px, py, own = x[scan], y[scan], sensor_owner[scan]
        far = find_tops(row_ranges, tops)
        # Where a lone ray goes.
        c0, s0 = math.cos(yaw[scan]), math.sin(yaw[scan])
        ux, uy = c0 * row_cos[0] - s0 * row_sin[0], s0 * row_cos[0] + c0 * row_sin[0]
        # The bins that hold the centres of whatever may be within reach, and at last the bin of what is wide.
        reach = far + o.reach[0]
        first_column, last_column = bin_at(o, px - reach, o.bin_x[0], 0), bin_at(o, px + reach, o.bin_x[0], 0)
        first_row, last_row = bin_at(o, py - reach, o.bin_y[0], 1), bin_at(o, py + reach, o.bin_y[0], 1)
        for row in range(first_row, last_row + 2):
            first, last = row * o.bins[0] + first_column, row * o.bins[0] + last_column
            if row > last_row:
                first = last = o.bins[0] * o.bins[1]
            for slot in range(o.bin_start[first], o.bin_start[last + 1]):
                group = o.in_bin[slot]
                dx, dy, radius = o.centre_x[group] - px, o.centre_y[group] - py, o.radius[group]
                square = dx * dx + dy * dy
                if (o.owner[group] == own and own != NO_MOVER) or square > (far + radius) * (far + radius):
                    continue
                if beams == 1 and (abs(ux * dy - uy * dx) > radius + _WIDE or ux * dx + uy * dy < -radius - _WIDE):
                    continue
                distance = math.sqrt(square)
                outside = distance > radius
                if outside and _is_hidden(
                    distance, _bearing(dy, dx) - yaw[scan], radius, angle_min, increment, slack, beams, tops
                ):
                    continue
                for shape in range(o.first_shape[group], o.first_shape[group + 1]):
                    if o.z_min[shape] <= z[scan] <= o.z_max[shape]:
                        _cast_shape(
                            o, shape, px, py, yaw[scan], row_cos, row_sin, angle_min, increment, slack,
                            outside, far, tops, row_ranges, row_hit,
                        )  # fmt: skip


@plainly(numpy_kernels.finish)
@compiled
def finish(
    ranges: Floats, hit: Ints, intensity: NDArray[np.float32], out: NDArray[np.float32], bright: NDArray[np.float32]
) -> None:
    """Ranges and the intensities of what was hit, as they are sent."""
    for scan in range(ranges.shape[0]):
        for beam in range(ranges.shape[1]):
            out[scan, beam] = ranges[scan, beam]
            bright[scan, beam] = intensity[hit[scan, beam]]
