"""Ground that a robot would drive over and does not see: its beams say nothing, or its laser looks elsewhere."""

import math

import numpy as np
from numpy.typing import NDArray

from zteam.behaviors.safety.surroundings import Sight, Surroundings
from zteam.behaviors.safety.swept import Arc, Outline, swings
from zteam.behaviors.safety.teammates import Teammates
from zteam.behaviors.view import View

Floats = NDArray[np.float64]

CREEP = 0.1
"""m/s of the fastest corner into ground never seen: a centimetre from one scan to the next."""
CREEPS = "creeps: the ground"
"""How the text of a robot begins that creeps."""
LOOK_STEP = 0.1
"""Metres between the places on an arc at which the ground before the base is looked at: twice, at least."""
MAX_LOOKS = 12
"""Such places, at most."""
DAZZLE_ANGLE = math.radians(5.0)
"""Radians to either side of a teammate whose pose is fresh within which beams that say nothing are explained: its laser
dazzles, by 2 degrees in the simulator. The teammate itself is known from its pose."""


def is_surely_seen(outline: Outline, arc: Arc, around: Surroundings) -> bool:
    """Whether there is no need to look for ground on this arc that is not seen; False says nothing."""
    if arc.speed and (around.is_blinded or not around.sees_all(arc.speed)):
        return False
    return bool(arc.speed and not swings(outline, arc)) or around.has_room()


def find_blind_spot(
    outline: Outline, arc: Arc, seconds: float, around: Surroundings, mates: Teammates, view: View
) -> tuple[bool, float]:
    """Whether a beam towards the way on `arc` says nothing; and seconds until ground never seen.

    Beams that say nothing do not count where the base turns on the spot.
    """
    speed, turn = arc
    sight = around.sight
    if sight is None and speed > 0.0:
        return True, math.inf
    leads = outline.front_edge if speed > 0.0 else outline.rear_edge
    if speed and sight is not None and sight.silent is not None:
        dark = _unexplained(sight, mates.bearings(view))
        if dark.size:
            points, _ = _on_the_way(leads, outline.radius, arc, seconds)
            in_view = around.in_view(points)
            if in_view.any() and _crosses(sight, dark, points[:, in_view]):
                return True, math.inf
    comes_out = bool(turn) if speed <= 0.0 else swings(outline, arc) and not around.has_room()
    if around.sees_all(speed) and not comes_out:
        return False, math.inf
    points, times = _on_the_way(outline.border if comes_out else leads, outline.radius, arc, seconds)
    beyond = ~around.sees(points) & (outline.distances(points) > 0.0)
    if not beyond.any():
        return False, math.inf
    unseen = around.never_seen(points[:, beyond])
    first = float(times[beyond].min(where=unseen, initial=math.inf))
    # It may begin just behind the place before.
    return False, first - float(times[0])


def _on_the_way(edge: Floats, radius: float, arc: Arc, seconds: float) -> tuple[Floats, Floats]:
    """Points (2, n): those of an `edge` (2, m) of the base, on its way, in the base frame now; and when they are there.

    No point of the edge is further than `radius` (m) from the origin.
    """
    speed, turn = arc
    fastest = abs(speed) + abs(turn) * radius
    count = min(MAX_LOOKS, max(2, math.ceil(fastest * seconds / LOOK_STEP)))
    times = np.arange(1, count + 1) * (max(seconds, 2.0 * LOOK_STEP / fastest) / count)
    angles = turn * times
    cos, sin = np.cos(angles)[:, None], np.sin(angles)[:, None]
    if abs(turn) > 1e-6:
        x, y = speed / turn * sin, speed / turn * (1.0 - cos)
    else:
        x, y = speed * times[:, None], np.zeros((count, 1))
    points = np.array((x + cos * edge[0] - sin * edge[1], y + sin * edge[0] + cos * edge[1]))
    return points.reshape(2, -1), np.repeat(times, edge.shape[1])


def _unexplained(sight: Sight, towards: list[tuple[float, float]]) -> Floats:
    """Angles of the silent beams, without those that a teammate's laser explains."""
    angles: Floats = sight.beams.directions.angles[sight.silent]
    for x, y in towards:
        bearing = math.atan2(y - sight.laser.y, x - sight.laser.x) - sight.laser.yaw
        angles = angles[np.abs(_wrap(angles - bearing)) > DAZZLE_ANGLE]
    return angles


def _crosses(sight: Sight, angles: Floats, points: Floats) -> bool:
    """Whether a beam at one of these angles points into the bearings between the points."""
    bearings = np.arctan2(points[1] - sight.laser.y, points[0] - sight.laser.x) - sight.laser.yaw
    middle = math.atan2(float(np.sin(bearings).sum()), float(np.cos(bearings).sum()))
    aside, off = _wrap(bearings - middle), _wrap(angles - middle)
    return bool(((off >= aside.min()) & (off <= aside.max())).any())


def _wrap(angles: Floats) -> Floats:
    """In [-pi, pi)."""
    wrapped: Floats = np.remainder(angles + math.pi, math.tau) - math.pi
    return wrapped
