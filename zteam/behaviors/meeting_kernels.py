"""Kernels that tell when a base meets points. The plain ones give the same bits.

Points are metres, (2, n), in the base frame.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from zteam.behaviors.jit import compiled, plainly

Floats = NDArray[np.float64]

# Numbers that kernels use stand in their own module: what is kept of a kernel hangs on the text of that alone.
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


@compiled
def _limit_of(x: float, y: float, planes: Floats, margin: float) -> float:
    """Metres that the base may come near to a point: `margin`, or less where it is nearer now."""
    depth = -math.inf
    for i in range(planes.shape[0]):
        depth = max(depth, planes[i, 0] * x + planes[i, 1] * y - planes[i, 2])
    return min(margin, max(depth - TOUCH, min(depth - ROUNDING, CLOSEST)))


def _limits_of(depths: Floats, margin: float) -> Floats:
    """As _limit_of, of points that are so far outside of each half-plane (m, n)."""
    deepest = np.maximum.reduce(depths)
    limits: Floats = np.minimum(margin, np.maximum(deepest - TOUCH, np.minimum(deepest - ROUNDING, CLOSEST)))
    return limits


def _meet_straight_numpy(points: Floats, planes: Floats, speed: float, margin: float) -> float:
    normal_x, normal_y, offsets, _ = planes.T[:, :, None]
    # Not a product of matrices, which may be fused.
    depths = normal_x * points[0] + normal_y * points[1] - offsets
    depths -= _limits_of(depths, margin)
    closing = speed * planes[:, 0] + 0.0
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        crossed = depths / closing[:, None]
    away = closing < 0.0
    enters = np.fmax.reduce(crossed[~away], axis=0, initial=0.0)
    leaves = np.fmin.reduce(crossed[away], axis=0, initial=np.inf)
    return float(enters.min(where=enters <= leaves, initial=np.inf))


@plainly(_meet_straight_numpy)
@compiled
def meet_straight(points: Floats, planes: Floats, speed: float, margin: float) -> float:
    """Seconds that a base drives straight on at `speed` (m/s) until it first meets a point: the point is in all
    half-planes at once. inf if it meets none. `planes` and `margin` are as for meet_turning.
    """
    met = math.inf
    for i in range(points.shape[1]):
        x, y = points[0, i], points[1, i]
        limit, enters, leaves = _limit_of(x, y, planes, margin), 0.0, math.inf
        for j in range(planes.shape[0]):
            # Adding 0 makes 0 of -0, which would turn infinities round.
            closing = speed * planes[j, 0] + 0.0
            crossed = (planes[j, 0] * x + planes[j, 1] * y - planes[j, 2] - limit) / closing
            # A point on the edge of a half-plane that the base moves along is no number, and in it.
            if closing < 0.0:
                leaves = crossed if crossed < leaves else leaves
            else:
                enters = crossed if crossed > enters else enters
        if enters <= leaves:
            met = min(met, enters)
    return met


@compiled
def _turn_until_met(
    x: float, y: float, away: float, planes: Floats, centre: float, side: float, margin: float, most: float
) -> float:
    """As meet_turning, for one point that is so far `away` from the centre."""
    away, limit = max(away, TINY), _limit_of(x, y, planes, margin)
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
        # Its numbers are Python's, which the loop adds in less time than numpy's.
        rows: Any = planes.data
        for turned, i in _guess_turns(points, away, planes, centre, side, margin, most):
            if turned > met + _WRONG:
                break
            x, y = points[:, i].tolist()
            met = min(met, _turn_until_met(x, y, away.item(i), rows, centre, side, margin, most))
    return met


def _guess_turns(
    points: Floats, away: Floats, planes: Floats, centre: float, side: float, margin: float, most: float
) -> list[tuple[float, int]]:
    """Radians after which points may be met, in their order, and which points: none of those that are is missing."""
    (x, y), away = points, np.maximum(away, TINY)
    normal_x, normal_y, offsets, bearings = planes.T[:, :, None]
    limits = _limits_of(normal_x * x + normal_y * y - offsets, margin)
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
