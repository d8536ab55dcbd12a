"""The two compiled laser kernels: bitmaps by empty squares, and polygons by their edges.

Method and figures: docs/benchmarks. Rays of one scan start at one point; `cos` and `sin` are the beams' directions in
the sensor's frame. Distances stay metric although the bitmap's cells may be unequal along x and y: the ray is scaled
into cells, its parameter is not.
"""

import math

import numpy as np
from numpy.typing import NDArray

from zteam.sim.compiling import compiled

_LANES = 32
"""Beams that advance together; LLVM turns the inner loop into vector code. 8 and 16 were slower."""
_TINY = 1e-9
"""Direction components are kept off zero, so that no division gives inf; 30 m away that is 30 nm."""
_EDGE = 1e-12
"""Edges reach this far beyond their ends, so that no ray slips through a corner."""

Floats = NDArray[np.float64]


@compiled
def cast_squares(
    sides: NDArray[np.uint8], rows: int, columns: int, cell_x: float, cell_y: float,
    x: Floats, y: Floats, yaw: Floats, seen: NDArray[np.bool_], cos: Floats, sin: Floats, limit: float, out: Floats,
) -> None:  # fmt: skip
    """Ranges from `x, y, yaw` (scans; metres from the bitmap's lower left corner) into `out` (scans, beams).

    No hit is `limit`; a scan that does not see the bitmap (`seen`) is all `limit`. A start inside an occupied cell
    gives 0.
    """
    beams = cos.shape[0]
    park = rows * columns
    ox, oy, ux, uy = np.empty(_LANES), np.empty(_LANES), np.empty(_LANES), np.empty(_LANES)
    t, vx, vy = np.empty(_LANES), np.empty(_LANES), np.empty(_LANES)
    ix, iy, base = np.empty(_LANES, np.int64), np.empty(_LANES, np.int64), np.empty(_LANES, np.int64)
    flat = sides.reshape(-1)
    stride = sides.shape[1]
    for scan in range(x.shape[0]):
        if not seen[scan]:
            out[scan, :] = limit
            continue
        px, py = x[scan] / cell_x, y[scan] / cell_y
        c0, s0 = math.cos(yaw[scan]), math.sin(yaw[scan])
        for first in range(0, beams, _LANES):
            count = min(_LANES, beams - first)
            for lane in range(_LANES):
                beam = first + min(lane, count - 1)
                dx = (c0 * cos[beam] - s0 * sin[beam]) / cell_x
                dy = (s0 * cos[beam] + c0 * sin[beam]) / cell_y
                quadrant = 0
                qx, qy = px, py
                jx, jy = math.floor(px), math.floor(py)
                if dx < 0.0:
                    quadrant, dx, qx, jx = 1, -dx, columns - px, columns - 1.0 - jx
                if dy < 0.0:
                    quadrant, dy, qy, jy = quadrant + 2, -dy, rows - py, rows - 1.0 - jy
                dx, dy = max(dx, _TINY), max(dy, _TINY)
                # A start outside enters through the near faces; one that has the bitmap behind it sees nothing.
                enter = max(0.0, max(-qx / dx, -qy / dy))
                base[lane] = quadrant * stride
                ox[lane], oy[lane], ux[lane], uy[lane] = qx, qy, 1.0 / dx, 1.0 / dy
                vx[lane], vy[lane] = dx, dy
                # On the far outer face itself the cell is the outermost one.
                jx = 0.0 if jx < 0.0 <= qx else jx
                jy = 0.0 if jy < 0.0 <= qy else jy
                t[lane] = enter
                if enter > 0.0:
                    jx, jy = math.floor(qx + enter * dx), math.floor(qy + enter * dy)
                    if -qx / dx > -qy / dy:
                        jx = 0.0
                    else:
                        jy = 0.0
                ix[lane], iy[lane] = int(jx), int(jy)
                if jx < 0 or jy < 0 or jx >= columns or jy >= rows or enter >= limit:
                    t[lane] = limit
                    ix[lane], iy[lane] = park, 0
            active = True
            while active:
                moved = 0
                for lane in range(_LANES):
                    side = flat[base[lane] + iy[lane] * columns + ix[lane]]
                    moving = side > 0
                    edge_x, edge_y = ix[lane] + side, iy[lane] + side
                    tx, ty = (edge_x - ox[lane]) * ux[lane], (edge_y - oy[lane]) * uy[lane]
                    by_x = tx <= ty
                    step = tx if by_x else ty
                    along_x = int(ox[lane] + step * vx[lane])
                    along_y = int(oy[lane] + step * vy[lane])
                    next_x = edge_x if by_x else min(max(along_x, ix[lane]), edge_x - 1)
                    next_y = min(max(along_y, iy[lane]), edge_y - 1) if by_x else edge_y
                    gone = moving and (next_x >= columns or next_y >= rows or step >= limit)
                    t[lane] = limit if gone else (step if moving else t[lane])
                    ix[lane] = park if gone else (next_x if moving else ix[lane])
                    iy[lane] = 0 if gone else (next_y if moving else iy[lane])
                    moved += 1 if moving else 0
                active = moved > 0
            for lane in range(count):
                out[scan, first + lane] = min(t[lane], limit)


@compiled
def cast_edges(
    ax: Floats, ay: Floats, bx: Floats, by: Floats, first_edge: NDArray[np.int64], centre_x: Floats, centre_y: Floats,
    radius: Floats, z_min: Floats, z_max: Floats, owner: NDArray[np.int64],
    x: Floats, y: Floats, z: Floats, yaw: Floats, sensor_owner: NDArray[np.int64], cos: Floats, sin: Floats,
    angle_min: float, increment: float, ranges: Floats, hit: NDArray[np.int64],
) -> None:  # fmt: skip
    """Shorten `ranges` (scans, beams) to polygons: shape k has edges first_edge[k] to first_edge[k + 1].

    `hit` becomes the index of the shape where one is nearer. A sensor does not see shapes of its own `owner`, nor
    those that its height `z` misses. Shapes that no laser sees are not to be passed in.
    """
    beams = cos.shape[0]
    for scan in range(x.shape[0]):
        far = 0.0
        for beam in range(beams):
            far = max(far, ranges[scan, beam])
        px, py, c0, s0 = x[scan], y[scan], math.cos(yaw[scan]), math.sin(yaw[scan])
        for shape in range(centre_x.shape[0]):
            if owner[shape] == sensor_owner[scan] or z[scan] < z_min[shape] or z[scan] > z_max[shape]:
                continue
            if math.hypot(centre_x[shape] - px, centre_y[shape] - py) - radius[shape] > far:
                continue
            for edge in range(first_edge[shape], first_edge[shape + 1]):
                # The edge's ends in the sensor's frame.
                ux, uy = ax[edge] - px, ay[edge] - py
                wx, wy = bx[edge] - px, by[edge] - py
                ux, uy = c0 * ux + s0 * uy, c0 * uy - s0 * ux
                wx, wy = c0 * wx + s0 * wy, c0 * wy - s0 * wx
                ex, ey = wx - ux, wy - uy
                cross = ux * ey - uy * ex
                start = math.atan2(uy, ux)
                span = math.atan2(ux * wy - uy * wx, ux * wx + uy * wy)
                low, width = (start, span) if span >= 0.0 else (start + span, -span)
                for turn in range(-1, 2):
                    lowest = low + turn * 2.0 * math.pi - angle_min
                    if increment > 0.0:
                        begin = max(0, math.ceil(lowest / increment - 1e-6))
                        end = min(beams - 1, math.floor((lowest + width) / increment + 1e-6))
                    else:
                        begin, end = 0, 0
                    for beam in range(begin, end + 1):
                        denominator = cos[beam] * ey - sin[beam] * ex
                        if abs(denominator) < 1e-15:
                            continue
                        along = cross / denominator
                        where = (sin[beam] * ux - cos[beam] * uy) / denominator
                        if along >= 0.0 and -_EDGE <= where <= 1.0 + _EDGE and along < ranges[scan, beam]:
                            ranges[scan, beam] = along
                            hit[scan, beam] = shape
