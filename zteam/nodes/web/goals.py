"""The goals of several robots that are sent to one place: each gets a place of its own around it. Pure."""

import itertools
import math
from collections.abc import Callable, Iterator, Mapping

from zteam.behaviors.assignment import assign
from zteam.geometry import Pose2

SPACING = 0.9
"""Metres between two goals: the widest of the lectures' robots turns on the spot in this."""
MAX_ASSIGNED = 64
"""Robots whose ways are compared; the cubic search takes too long for more."""


def spread(
    goal: Pose2, poses: Mapping[int, Pose2], is_free: Callable[[float, float], bool] = lambda _x, _y: True
) -> dict[int, Pose2]:
    """A goal for each robot, with the heading of `goal`: the places nearest to it that are free, one of them itself.

    `poses` is where the robots are. The sum of the squares of their ways is least.
    """
    robots = sorted(poses)
    places = _nearest_places(goal, len(robots), is_free)
    if len(robots) > MAX_ASSIGNED:
        order = range(len(robots))
    else:
        ways = [[(p.x - poses[i].x) ** 2 + (p.y - poses[i].y) ** 2 for p in places] for i in robots]
        order = assign(ways)  # type: ignore[assignment]
    return {robot_id: places[place] for robot_id, place in zip(robots, order, strict=True)}


def _nearest_places(goal: Pose2, count: int, is_free: Callable[[float, float], bool]) -> list[Pose2]:
    found: list[Pose2] = []
    # Twice as far as an open floor needs: behind that, a place in a wall is no worse than one in another room.
    rings = 2 + 2 * math.ceil(math.sqrt(count))
    taken: list[Pose2] = []
    for x, y in _hexagons(rings):
        place = goal.compose(Pose2(SPACING * x, SPACING * y, 0.0))
        (found if not found or is_free(place.x, place.y) else taken).append(place)
        if len(found) == count:
            return found
    return (found + taken)[:count]


def _hexagons(rings: int) -> Iterator[tuple[float, float]]:
    """The points of a triangular grid of side 1, ring after ring, the middle first."""
    corners = [(math.cos(k * math.pi / 3), math.sin(k * math.pi / 3)) for k in range(7)]
    yield 0.0, 0.0
    for ring in range(1, rings + 1):
        for (x0, y0), (x1, y1) in itertools.pairwise(corners):
            for step in range(ring):
                share = step / ring
                yield ring * (x0 + share * (x1 - x0)), ring * (y0 + share * (y1 - y0))
