"""The way along what stands between a robot and its goal, and where to leave it (DistBug, Kamon and Rivlin 1997).

The robot keeps the obstacle on one side. It leaves where the way towards the goal is open and leads nearer to the goal
than it has been since it met the obstacle. So each obstacle brings it nearer, and a dead end holds it only once. When
it has gone all round the obstacle without such a place there is no way.
"""

import math

from zteam.behaviors.scans import first_clear, is_clear, is_seen, look_along
from zteam.geometry import Pose2, normalize_angle
from zteam.messages import LaserScan

REACH = 0.6
"""Metres ahead of the laser that have to be clear."""
ALONG = 0.75
"""The same on the way along an obstacle: so what was met stays in reach when the laser turns with the base."""
GAIN = 0.3
"""Metres nearer to the goal that leaving has to bring: less is soon lost again."""
_STEP = math.radians(10.0)
_AWAY = {side: tuple(side * step * _STEP for step in range(1, 28)) for side in (1.0, -1.0)}
"""Turns away from the obstacle, up to three quarters of a circle, by the side on which it goes round."""
_SQUARE = 0.5 * math.pi
_TOWARDS = 12
"""Headings that are tried towards the obstacle; where all are clear it is not seen."""
_GONE = 5
"""Steps without seeing it after which the obstacle is not there any more: a thin wall is not seen along its line."""
_ROUND = 1.2
"""Metres from where it met the obstacle to the place to come back to, and away from that before coming back counts."""
_BACK = 0.6
"""Metres from that place within which it is back."""
_ONWARD = 0.5
"""Cosine of the angle to the heading that it had there, from which on it is back."""
_DETOURS = tuple(side * step * _STEP for step in range(1, 13) for side in (1.0, -1.0))
"""Turns from the bearing, the least first; left before right."""


class Boundary:
    """Going round one obstacle, from where it was met on."""

    def __init__(self, own: Pose2, bearing: float, distance: float, side: float) -> None:
        """`bearing` and `distance`: of the goal. `side` is 1 with the obstacle on the right, -1 on the left."""
        self._mark = own
        """Where it met the obstacle, and then the place to come back to."""
        self._is_along = False
        self.side = side
        self._heading = own.yaw + bearing + side * _SQUARE
        """In map: the heading taken last; at first along what stands in the straight way."""
        self._least = distance
        self._was_away = False
        self.is_closed = False
        """Whether it has gone all round."""
        self._unseen = 0
        """Steps in a row in which it did not see the obstacle."""

    def heading(self, scan: LaserScan, half_width: float, own: Pose2) -> float | None:
        """The clear heading next to the obstacle (rad, in the base); None where no heading is clear.

        It looks from the side of the heading taken last on, where the obstacle is: so a door in a wall is not missed.
        """
        last = normalize_angle(self._heading - own.yaw)
        start = last - self.side * _SQUARE
        heading = first_clear(scan, half_width, ALONG, start, _AWAY[self.side])
        if heading == start:
            # The obstacle is narrow, or it ends: look for its edge from this side.
            heading = first_clear(scan, half_width, ALONG, last, _AWAY[self.side])
            if heading == last:
                heading = self._nearest_clear(scan, half_width, last)
        else:
            self._unseen = 0
        if heading is None:
            return None
        self._heading = own.yaw + heading
        return normalize_angle(heading)

    def _nearest_clear(self, scan: LaserScan, half_width: float, heading: float) -> float:
        """The last clear heading from a clear one towards the obstacle."""
        for reach in (ALONG, 2.0 * ALONG):
            for step in range(_TOWARDS):
                nearer = heading - self.side * (step + 1) * _STEP
                if not is_clear(scan, half_width, reach, nearer):
                    self._unseen = 0
                    return heading - self.side * step * _STEP
        self._unseen += 1
        return heading

    def may_leave(self, scan: LaserScan, half_width: float, bearing: float, distance: float, own: Pose2) -> bool:
        """Whether to head for the goal from here; called once a step."""
        if self._unseen >= _GONE:
            return True
        self._watch_for_closing(own)
        if not is_seen(scan, bearing):
            return False
        room = look_along(scan, half_width, bearing)
        left = distance - min(room, distance)
        if left <= self._least - GAIN and room >= min(ALONG, distance):
            return True
        self._least = min(self._least, left)
        return False

    def _watch_for_closing(self, own: Pose2) -> None:
        """It is all round when it comes back to a place that it passed in the same direction.

        The place is a little way along. Where it met the obstacle it may be a doorway, which it passes from both sides.
        """
        away = math.hypot(own.x - self._mark.x, own.y - self._mark.y)
        if away > _ROUND and not self._is_along:
            self._mark, self._is_along = own, True
            return
        self._was_away = self._was_away or (self._is_along and away > _ROUND)
        is_back = away < _BACK and math.cos(own.yaw - self._mark.yaw) > _ONWARD
        self.is_closed = self.is_closed or (self._was_away and is_back)


def meet(scan: LaserScan, half_width: float, bearing: float, distance: float, own: Pose2) -> Boundary | None:
    """The obstacle in the straight way to the goal, passed on the side of the lesser turn; None if it is clear."""
    reach = min(REACH, distance)
    heading = first_clear(scan, half_width, reach, bearing, _DETOURS)
    if heading == bearing:
        return None
    return Boundary(own, bearing, distance, -1.0 if heading is not None and heading < bearing else 1.0)
