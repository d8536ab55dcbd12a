"""Kernels that look at what is remembered of scans. The plain ones on numpy give the same bits.

Points are metres, (2, n). A frame is given as x, y, cosine and sine of its yaw.
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
_FEW = 5
"""numpy asks one scan of so many first what it saw: mostly that is all that any scan saw."""


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
def _look(start: float, step: float, distances: Floats, x: float, y: float) -> float:
    """As `look`, for one point. numpy's `arctan2` may differ in the last bit, but here it only chooses a sector."""
    place = ((math.atan2(y, x) - start) * math.copysign(1.0, step)) % math.tau
    index = int(place / max(abs(step), FINEST) + 0.5)
    # An index that no number made must not be used.
    return distances[index] if 0 <= index < distances.size else math.nan


@compiled
def _is_told(start: float, step: float, distances: Floats, x: float, y: float) -> bool:
    """Whether a scan tells of a point of the laser's frame: it saw it, or through it."""
    return _look(start, step, distances, x, y) >= math.hypot(x, y) - SEEN_WITHIN


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


def _clear_seen_numpy(
    unseen: Flags, places: Floats, frames: Floats, start: float, step: float, distances: Floats, rear: float,
    front: float, half_width: float,
) -> None:  # fmt: skip
    for some in (slice(None, None, _FEW), slice(None)):
        at = unseen.nonzero()[0]
        if not at.size:
            break
        base_x, base_y, base_cos, base_sin, laser_x, laser_y, cos, sin = frames[some].T[:, :, None]
        px, py = places.take(at, axis=1)
        dx, dy = px - base_x, py - base_y
        along, across = base_cos * dx + base_sin * dy, base_cos * dy - base_sin * dx
        seen = ((along >= -rear) & (along <= front) & (np.abs(across) <= half_width)).any(axis=0)
        dx, dy = px - laser_x, py - laser_y
        saw = look(start, step, distances[some], cos * dx + sin * dy, cos * dy - sin * dx)
        unseen[at] = ~(seen | (saw >= np.hypot(dx, dy)).any(axis=0))


@plainly(_clear_seen_numpy)
@compiled
def clear_seen(
    unseen: Flags, places: Floats, frames: Floats, start: float, step: float, distances: Floats, rear: float,
    front: float, half_width: float,
) -> None:  # fmt: skip
    """Clear the flags (n,) of places (2, n) that a scan saw, or its base stood on, which reaches so far (m).

    `frames` (m, 8) are the base's and the laser's at each scan, `distances` (m, k) the sectors of all scans.
    """
    for i in range(unseen.size):
        # Where a base stood is told without an angle.
        for k in range(frames.shape[0]):
            dx, dy = places[0, i] - frames[k, 0], places[1, i] - frames[k, 1]
            along, across = frames[k, 2] * dx + frames[k, 3] * dy, frames[k, 2] * dy - frames[k, 3] * dx
            if -rear <= along <= front and abs(across) <= half_width:
                unseen[i] = False
                break
        for k in range(frames.shape[0]):
            if not unseen[i]:
                break
            dx, dy = places[0, i] - frames[k, 4], places[1, i] - frames[k, 5]
            along, across = frames[k, 6] * dx + frames[k, 7] * dy, frames[k, 6] * dy - frames[k, 7] * dx
            unseen[i] = not _look(start, step, distances[k], along, across) >= math.hypot(dx, dy)
