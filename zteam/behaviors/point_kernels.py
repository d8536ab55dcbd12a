"""Kernels that look at points which a laser met: what is remembered of them, and when the base meets them.

Points are metres, (2, n). A frame is given as x, y, cosine and sine of its yaw. The plain kernels give the same bits.
"""

import math

import numpy as np
from numpy.typing import NDArray

from zteam.behaviors.jit import compiled, plainly

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

# Numbers that kernels use stand in their own module: what is kept of a kernel hangs on the text of that alone.
SEEN_WITHIN = 0.05
"""Metres that a point may seem to lie behind what a beam met and still be the same."""
FINEST = 1e-9
"""Radians: finer sectors are no laser's, and their places too large for a number."""
TOUCH = 1e-3
"""Metres by which the base may come nearer, in each look, to what is nearer than the margin already: it may drive along
a wall that it does not quite see as straight."""
CLOSEST = 2e-3
"""Metres: nearer than this it may not come so either. Between beams 0.5° apart so much of a corner is not seen."""
ROUNDING = 1e-6
"""Metres: what is nearer than CLOSEST may come nearer by this, so that rounding stops no base that moves along it."""
TINY = 1e-9
"""Metres: what numbers are wrong by."""
_WRONG = 1e-10
"""Radians: numpy's angles are wrong by less."""


def look(start: float, step: float, distances: Floats, x: Floats, y: Floats) -> Floats:
    """How far a laser saw towards points of its frame, as `zteam.behaviors.safety.sectors.Sectors` says."""
    places = np.remainder((np.arctan2(y, x) - start) * math.copysign(1.0, step), math.tau)
    index = (places / max(abs(step), FINEST) + 0.5).astype(np.intp)
    count = distances.shape[-1]
    at = np.minimum(index, count - 1)
    if distances.ndim > 1:
        at += np.arange(0, distances.size, count)[:, None]
    return np.where(index < count, distances.take(at), np.nan)


def _are_told(start: float, step: float, distances: Floats, x: Floats, y: Floats) -> Flags:
    told: Flags = look(start, step, distances, x, y) >= np.hypot(x, y) - SEEN_WITHIN
    return told


@compiled
def _is_told(start: float, step: float, distances: Floats, x: float, y: float) -> bool:
    """Whether a scan tells of a point of the laser's frame: it saw it, or through it.

    numpy's `arctan2` may differ in the last bit, but here it only chooses a sector.
    """
    place = ((math.atan2(y, x) - start) * math.copysign(1.0, step)) % math.tau
    index = int(place / max(abs(step), FINEST) + 0.5)
    # An index that no number made must not be used.
    return 0 <= index < distances.size and distances[index] >= math.hypot(x, y) - SEEN_WITHIN


def _select_untold_numpy(
    points: Floats, x: float, y: float, cos: float, sin: float, start: float, step: float, distances: Floats,
    untold: Floats,
) -> int:  # fmt: skip
    dx, dy = points[0] - x, points[1] - y
    at = (~_are_told(start, step, distances, cos * dx + sin * dy, cos * dy - sin * dx)).nonzero()[0]
    untold[:, : at.size] = points.take(at, axis=1)
    return at.size


@plainly(_select_untold_numpy)
@compiled
def select_untold(
    points: Floats, x: float, y: float, cos: float, sin: float, start: float, step: float, distances: Floats,
    untold: Floats,
) -> int:  # fmt: skip
    """The points that a scan does not tell of, into `untold` (2, n); how many there are.

    The laser's frame is (x, y, cos, sin); `start`, `step` and `distances` are the sectors of its scan.
    """
    count = 0
    for i in range(points.shape[1]):
        dx, dy = points[0, i] - x, points[1, i] - y
        if not _is_told(start, step, distances, cos * dx + sin * dy, cos * dy - sin * dx):
            untold[0, count], untold[1, count] = points[0, i], points[1, i]
            count += 1
    return count


def _add_scan_numpy(
    cloud: Floats, born: Floats, oldest: float, now: float, x: float, y: float, cos: float, sin: float, start: float,
    step: float, distances: Floats, axes: Floats, reach: float, points: Floats, times: Floats,
) -> int:  # fmt: skip
    kept = born >= oldest
    if kept.any():
        dx, dy = cloud[0] - x, cloud[1] - y
        kept &= ~_are_told(start, step, distances, cos * dx + sin * dy, cos * dy - sin * dx)
    stays, hits = kept.nonzero()[0], (distances < reach).nonzero()[0]
    old, count = stays.size, stays.size + hits.size
    along, across = distances.take(hits) * axes.take(hits, axis=1)
    points[:, :old] = cloud.take(stays, axis=1)
    points[:, old:count] = x + cos * along - sin * across, y + sin * along + cos * across
    times[:old], times[old:count] = born.take(stays), now
    return count


@plainly(_add_scan_numpy)
@compiled
def add_scan(
    cloud: Floats, born: Floats, oldest: float, now: float, x: float, y: float, cos: float, sin: float, start: float,
    step: float, distances: Floats, axes: Floats, reach: float, points: Floats, times: Floats,
) -> int:  # fmt: skip
    """The cloud with a scan, into `points` (2, n) and `times` (n,): how many points there are now.

    Points of the cloud stay that were `born` at `oldest` or later and that the scan does not tell of. Hits within
    `reach` are born `now`. The laser's frame, as (x, y, cos, sin), and the scan's sectors are given with their `axes`.
    """
    count = 0
    for i in range(born.size):
        if born[i] >= oldest:
            dx, dy = cloud[0, i] - x, cloud[1, i] - y
            if not _is_told(start, step, distances, cos * dx + sin * dy, cos * dy - sin * dx):
                points[0, count], points[1, count], times[count] = cloud[0, i], cloud[1, i], born[i]
                count += 1
    for i in range(distances.size):
        if distances[i] < reach:
            along, across = distances[i] * axes[0, i], distances[i] * axes[1, i]
            points[0, count] = x + cos * along - sin * across
            points[1, count] = y + sin * along + cos * across
            times[count] = now
            count += 1
    return count


def _select_near_numpy(
    points: Floats, x: float, y: float, cos: float, sin: float, left: float, right: float, bottom: float, top: float,
    reach: float, near: Floats,
) -> int:  # fmt: skip
    dx, dy = points[0] - x, points[1] - y
    along, across = cos * dx + sin * dy, cos * dy - sin * dx
    inside = (along >= left) & (along <= right) & (across >= bottom) & (across <= top)
    at: NDArray[np.intp] = (inside & (dx * dx + dy * dy <= reach * reach)).nonzero()[0]
    near[0, : at.size], near[1, : at.size] = along.take(at), across.take(at)
    return at.size


@plainly(_select_near_numpy)
@compiled
def select_near(
    points: Floats, x: float, y: float, cos: float, sin: float, left: float, right: float, bottom: float, top: float,
    reach: float, near: Floats,
) -> int:  # fmt: skip
    """The points in a box of the frame (x, y, cos, sin), and within `reach` of its origin, as points of this frame:
    into `near` (2, n); how many there are.
    """
    count = 0
    for i in range(points.shape[1]):
        dx, dy = points[0, i] - x, points[1, i] - y
        along, across = cos * dx + sin * dy, cos * dy - sin * dx
        inside = left <= along <= right and bottom <= across <= top
        if inside and dx * dx + dy * dy <= reach * reach:
            near[0, count], near[1, count] = along, across
            count += 1
    return count


@compiled
def _turn_until_met(
    x: float, y: float, away: float, planes: Floats, centre: float, side: float, margin: float, most: float
) -> float:
    """As meet_turning, for one point that is so far `away` from the centre."""
    away = max(away, TINY)
    depth = -math.inf
    for i in range(planes.shape[0]):
        depth = max(depth, planes[i, 0] * x + planes[i, 1] * y - planes[i, 2])
    limit = min(margin, max(depth - TOUCH, min(depth - ROUNDING, CLOSEST)))
    bearing, met = math.atan2(y - centre, x), math.inf
    for i in range(planes.shape[0]):
        # Seen from the centre: how far the half-plane reaches, with the limit.
        share = (planes[i, 2] - planes[i, 1] * centre + limit) / away
        turned = (math.acos(min(max(share, -1.0), 1.0)) + side * (bearing - planes[i, 3])) % math.tau
        if turned <= most and turned < met:
            there = bearing - side * turned
            along, across = away * math.cos(there), away * math.sin(there)
            deepest = -math.inf
            for j in range(planes.shape[0]):
                reach = planes[j, 2] - planes[j, 1] * centre
                deepest = max(deepest, planes[j, 0] * along + planes[j, 1] * across - reach)
            if deepest <= limit + TINY:
                met = turned
    return met


def _meet_turning_plainly(
    points: Floats, planes: Floats, centre: float, side: float, inner: float, outer: float, margin: float, most: float
) -> float:
    # numpy's functions of arrays may differ in the last bits from those of `math`, and `math.hypot` from the C
    # library's. So numpy tells which points may be met first, and the kernel's own loop when.
    away = np.hypot(points[0], points[1] - centre)
    near = ((away >= inner) & (away <= outer)).nonzero()[0]
    met = math.inf
    if near.size:
        points, away = points.take(near, axis=1), away.take(near)
        for turned, i in _guess_turns(points, away, planes, centre, side, margin, most):
            if turned > met + _WRONG:
                break
            x, y = points[:, i].tolist()
            met = min(met, _turn_until_met(x, y, away.item(i), planes, centre, side, margin, most))
    return met


def _guess_turns(
    points: Floats, away: Floats, planes: Floats, centre: float, side: float, margin: float, most: float
) -> list[tuple[float, int]]:
    """Radians after which points may be met, in their order, and which points: none of those that are is missing."""
    (x, y), away = points, np.maximum(away, TINY)
    normal_x, normal_y, offsets, bearings = planes.T[:, :, None]
    depths = np.maximum.reduce(normal_x * x + normal_y * y - offsets)
    limits = np.minimum(margin, np.maximum(depths - TOUCH, np.minimum(depths - ROUNDING, CLOSEST)))
    reach, bearing = offsets - normal_y * centre, np.arctan2(y - centre, x)
    turned = np.arccos(np.minimum(np.maximum((reach + limits) / away, -1.0), 1.0)) + side * (bearing - bearings)
    # A whole turn that is a little less may be none.
    turned = np.remainder(turned + _WRONG, math.tau) - _WRONG
    sides, at = (turned <= most + _WRONG).nonzero()
    turned = turned[sides, at]
    there = bearing.take(at) - side * turned
    along, across = away.take(at) * np.cos(there), away.take(at) * np.sin(there)
    inside = np.maximum.reduce(normal_x * along + normal_y * across - reach) <= limits.take(at) + 2.0 * TINY
    return sorted(zip(turned[inside].tolist(), at[inside].tolist(), strict=True))


@plainly(_meet_turning_plainly)
@compiled
def meet_turning(
    points: Floats, planes: Floats, centre: float, side: float, inner: float, outer: float, margin: float, most: float
) -> float:
    """Radians that a base turns about (0, `centre`), at most `most`, until it first meets a point; inf if it does not.

    Seen from the base, each point goes round the centre, from left to right where `side` is 1, else (-1) from right to
    left. It comes into the outline where it crosses the edge of a half-plane and then is in all the others. `planes`
    (m, 4) are these: outward normal, offset, bearing of the normal. A point is met that comes nearer than `margin`, and
    nearer than it is. Points that are nearer to the centre than `inner`, or further than `outer`, are never met.
    """
    met = math.inf
    for i in range(points.shape[1]):
        x, y = points[0, i], points[1, i]
        away = math.hypot(x, y - centre)
        if inner <= away <= outer:
            met = min(met, _turn_until_met(x, y, away, planes, centre, side, margin, min(most, met)))
    return met
