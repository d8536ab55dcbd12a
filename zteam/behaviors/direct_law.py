"""The lectures' law of following, mended: to the robot in front by the transforms alone, round what stands between."""

import math
from collections.abc import Sequence, Set

from zteam.behaviors.chain import see_robot
from zteam.behaviors.detour import Detour, find_standing
from zteam.behaviors.follow_params import FollowParams
from zteam.behaviors.nearby import Nearby
from zteam.behaviors.pursuit import Limits
from zteam.behaviors.scans import Beams, beams_of, first_clear
from zteam.behaviors.view import View
from zteam.geometry import Pose2, normalize_angle
from zteam.messages import LaserScan, Twist, Vector3

LINEAR_GAIN = 0.5
"""1/s: the lectures' v = 0.5 d."""
ANGULAR_GAIN = 4.0
"""1/s: the lectures' w = 4 atan2(y, x)."""
REACH = 0.6
"""Metres ahead of the laser that have to be clear."""
LEADER_ROOM = 0.3
"""Metres before the leader's base where its own body begins to be seen."""
FAR = 2.0
"""Times the distance at which it stands: at its greatest speed it follows from less."""
SIDE_MARGIN = 0.075
"""Metres that have to be free on either side of the base."""
DETOUR_STEP = math.radians(10.0)
DETOUR_STEPS = 12
"""It looks for a way round up to so far from the leader's bearing."""


def _detours(*sides: float) -> tuple[float, ...]:
    """Turns to these sides, the least first."""
    return tuple(side * step * DETOUR_STEP for step in range(1, DETOUR_STEPS + 1) for side in sides)


_DETOURS = {0.0: _detours(1.0, -1.0), 1.0: _detours(1.0) + _detours(-1.0), -1.0: _detours(-1.0) + _detours(1.0)}
"""Turns from the bearing in the order in which they are tried, by the side on which it goes round."""


class DirectLaw:
    """Turn to the robot in front and drive up to it, round what stands between."""

    def __init__(self, detour: Detour | None = None, nearby: Nearby | None = None) -> None:
        """`detour` and `nearby` are those of the law that this one is a part of.

        The detour keeps the side on which the robot passes.
        """
        self._side = 0.0
        """1 while going round something on its left, -1 on its right, 0 with a clear way."""
        self._beams: Beams | None = None
        self._asked: tuple[float, ...] = ()
        """What a clear heading was looked for last, and in what: a robot that stands looks for the same again."""
        self._heading: float | None = None
        """What was found."""
        self._detour = detour or Detour()
        self._nearby = nearby or Nearby()

    def step(
        self, view: View, chain: Sequence[int], gone: Set[int], params: FollowParams, min_dist: float | None = None
    ) -> tuple[Twist, str]:
        """The velocity, and why it is zero: the place of the first robot of the `chain` is not known for certain.

        Robots that are `gone` may stand on the way. `min_dist` (m) holds instead of that of `params`.
        """
        seen, reason = see_robot(view, chain[0], view.base_frame, params.stale_after)
        if seen is None:
            return Twist(), reason
        x, y, _ = seen.pose
        distance = math.hypot(x, y)
        stand = params.min_dist if min_dist is None else min_dist
        if distance <= stand:
            return Twist(), ""
        most = min(LINEAR_GAIN * distance, params.max_linear)
        if x < 0.0 or distance > FAR * stand:
            # Not behind its leader, or others have come between.
            gone = (gone | self._nearby.find(view)) - {chain[0]}
        own = view.map_from_base() if gone else None
        if own is not None:
            share = 1.0 - stand / distance
            to = own[0].compose(Pose2(share * x, share * y, 0.0))
            limits = Limits(params.max_linear, params.max_angular)
            command, is_bent = self._detour.drive(view, own[0], to, find_standing(view, gone), most, limits)
            if is_bent:
                return command, ""
        angle = math.atan2(y, x)
        if view.scan is not None:
            angle = self._way_round(view.scan, angle, distance, view.base.half_width + SIDE_MARGIN)
        # A leader behind is turned to on the spot: driving would lead away from it.
        speed = 0.0 if abs(angle) > 0.5 * math.pi else most
        turn = max(-params.max_angular, min(params.max_angular, ANGULAR_GAIN * angle))
        return Twist(Vector3(speed), Vector3(z=turn)), ""

    def _way_round(self, scan: LaserScan, bearing: float, distance: float, half_width: float) -> float:
        """The heading to take: the bearing, or the nearest to it that is clear where something stands between.

        It goes round on the side it chose until the bearing is clear again, so it does not swing in front of a post;
        without any clear heading it keeps to the bearing.
        """
        beams, asked = beams_of(scan), (half_width, min(REACH, distance - LEADER_ROOM), bearing, self._side)
        if beams is not self._beams or asked != self._asked:
            self._beams, self._asked = beams, asked
            self._heading = first_clear(scan, *asked[:3], _DETOURS[self._side])
        heading = self._heading
        if heading is None or heading == bearing:
            self._side = 0.0
            return bearing
        self._side = math.copysign(1.0, heading - bearing)
        return normalize_angle(heading)
