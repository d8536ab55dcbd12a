"""The law of `follow` that keeps a chain together: each robot keeps its distance behind the head, along its trail.

All robots of a chain measure from the same robot, so errors do not add up from one to the next.
"""

import math
from collections.abc import Sequence, Set

from zteam import names
from zteam.behaviors.chain import Seen, see_robot
from zteam.behaviors.detour import Detour, Standing, find_standing
from zteam.behaviors.direct_law import SIDE_MARGIN, DirectLaw
from zteam.behaviors.follow_params import FollowParams
from zteam.behaviors.leader_trail import LeaderTrail
from zteam.behaviors.nearby import Nearby, cannot_meet_before
from zteam.behaviors.polyline import Polyline
from zteam.behaviors.pursuit import LOOK_AHEAD, Limits, pursue
from zteam.behaviors.scans import is_clear
from zteam.behaviors.view import View
from zteam.geometry import Pose2
from zteam.messages import Twist

GAP_GAIN = 1.0
"""1/s: speed besides the head's, by the error of the distance to it."""
PARKED, LEFT = 0.03, 0.1
"""Metres to its place behind a standing head at which a robot stops, and at which it goes on."""
OFF = 0.3
"""Metres from the trail from which on a robot drives straight to its leader instead."""
LAGS = 0.5
"""Gaps behind its place from which on a robot overtakes those that belong behind it."""
BESIDE = 0.8
"""Metres behind the own place up to which an overtaken robot counts as beside."""
NEAR = 1.0
"""Metres from the trail up to which it turns into it where the way is clear."""
BEHIND = 1.25
"""Gaps behind the beginning of the trail up to which a robot stands in line already."""
JOINING = 0.4
"""m/s of a robot that drives from before its leader to behind it."""
_STEP = 0.1
"""Metres between two points of a trail that is taken over."""
_BACK, _AHEAD = 0.2, 0.5
"""Metres of the trail around a robot's last place in which its next one is sought: the trail may cross itself."""


class TrailLaw:
    """Keep a place on the trail of the robot that leads the chain, `gap` metres for each robot in front.

    A robot that did not see the head drive begins with the way over the places of the robots in front of it.
    """

    def __init__(self) -> None:
        self._trail = LeaderTrail()
        self._head: int | None = None
        """Whose trail it is."""
        self._place: float | None = None
        """The own place on the trail; None before the first step on it."""
        self._detour = Detour()
        self._nearby = Nearby()
        self._direct = DirectLaw(self._detour, self._nearby)
        self._is_parked = False
        self._away_until = 0
        """Nanoseconds: before this the robot cannot be near the trail, so its place is not sought."""

    @property
    def trail(self) -> Polyline:
        """The trail of the robot that leads the chain, in map, as far as it is known."""
        return self._trail.path

    def step(self, view: View, chain: Sequence[int], gone: Set[int], params: FollowParams) -> tuple[Twist, str]:
        """The velocity, and why it is zero: a place that it needs is not known for certain.

        `chain` are the robots in front, up to the head. Robots that are `gone` may stand on the trail.
        """
        own = view.map_from_base()
        if own is None or not all(map(math.isfinite, own[0])):
            return Twist(), f"its own pose in {names.MAP_FRAME} is not known"
        head, reason = see_robot(view, chain[-1], names.MAP_FRAME, params.stale_after)
        if head is None:
            return Twist(), reason
        self._take(view, chain, head)
        trail = self._trail
        age = max(0.0, (view.now - head.stamp) / 1e9) if head.stamp else 0.0
        target = trail.place + trail.speed * age - params.gap * len(chain)
        return self._drive(view, own[0], chain, gone, target, params)

    def _take(self, view: View, chain: Sequence[int], head: Seen) -> None:
        """The newest pose of the head; begins a new trail if it is another head, or was set down elsewhere."""
        trail, stamp = self._trail, head.stamp or view.now
        if chain[-1] != self._head or trail.is_far(head.pose):
            trail.begin(head.pose, stamp, self._way_to(head.pose) or self._places_behind(view, chain, head.pose))
            self._head, self._place, self._away_until = chain[-1], None, 0
            return
        # What lies before its own place is needed no more.
        begin = trail.path.start if self._place is None else self._place
        trail.go_on(head.pose, stamp, trail.place - begin + 1.0)

    def _way_to(self, head: Pose2) -> list[Pose2]:
        """The way to a new head that stands on the trail of the last one, which is gone: up to it that trail."""
        path = self._trail.path
        place = path.project(head.x, head.y) if len(path) else 0.0
        if not len(path) or _distance(head, path.at(place)) > OFF:
            return []
        count = int((place - path.start) / _STEP)
        return [path.at(place - (count - i) * _STEP) for i in range(count)]

    def _places_behind(self, view: View, chain: Sequence[int], head: Pose2) -> list[Pose2]:
        """The places of the robots in front that stand behind the head."""
        seen = (see_robot(view, robot, names.MAP_FRAME, math.inf)[0] for robot in chain[:-1])
        return [each.pose for each in seen if each is not None and _metres_before(head, each.pose) < 0.0]

    def _drive(
        self, view: View, own: Pose2, chain: Sequence[int], gone: Set[int], target: float, params: FollowParams
    ) -> tuple[Twist, str]:
        """Along the trail towards the place `target`; straight to the leader from elsewhere."""
        trail = self._trail
        if view.now < self._away_until:
            return self._join(view, own, chain, gone, params)
        place, off = self._find_place(own, target)
        is_behind = place <= trail.path.start
        in_line = is_behind and off <= BEHIND * params.gap
        is_away = off > OFF and not in_line
        bent = None
        if not is_away or off <= NEAR + self._detour.swing:
            belong_behind = self._nearby.find(view) - {*chain} if target - place > LAGS * params.gap else set()
            bent = self._detour.bend(view, trail.path, place, self._find_in_the_way(view, place, gone, belong_behind))
        if is_away and bent is None and not self._is_near(view, own, place, off):
            self._is_parked = False
            self._away_until = cannot_meet_before(view.now, off - max(NEAR + self._detour.swing, BEHIND * params.gap))
            return self._join(view, own, chain, gone, params)
        error = target - place + (off if is_behind else 0.0)
        if self._parks(error):
            return Twist(), ""
        speed = min(max(trail.speed + GAP_GAIN * error, 0.0), params.max_linear)
        limits = Limits(params.max_linear, params.max_angular)
        if bent is not None:
            return pursue(own, bent, bent.project(own.x, own.y), speed, limits), ""
        return pursue(own, trail.path, place, speed, limits), ""

    def _find_in_the_way(self, view: View, place: float, gone: Set[int], others: Set[int]) -> list[Standing]:
        """Robots that are gone, and those of the `others` that are ahead of the own place, or beside."""
        found, path = find_standing(view, gone), self._trail.path
        mates = find_standing(view, others - gone)
        return found + [mate for mate in mates if path.project(mate.x, mate.y, place - BESIDE) > place - BESIDE]

    def _is_near(self, view: View, own: Pose2, place: float, off: float) -> bool:
        """Whether a robot beside the trail can turn into it at once: that is not far, and the way is clear."""
        if off > NEAR or view.scan is None:
            return False
        to = own.inverse().compose(self._trail.path.at(place + LOOK_AHEAD))
        return is_clear(view.scan, view.base.half_width + SIDE_MARGIN, math.hypot(to.x, to.y), math.atan2(to.y, to.x))

    def _join(
        self, view: View, own: Pose2, chain: Sequence[int], gone: Set[int], params: FollowParams
    ) -> tuple[Twist, str]:
        """Straight to the leader; where the robot is before the head, to its place behind it, past all on the way."""
        head, mates = self._trail.leader, self._nearby.find(view) | gone
        if _metres_before(head, own) <= 0.0:
            return self._direct.step(view, chain, mates - {chain[0]}, params, params.gap)
        place = head.compose(Pose2(-params.gap * len(chain), 0.0, 0.0))
        limits = Limits(params.max_linear, params.max_angular)
        return self._detour.drive(view, own, place, find_standing(view, mates), JOINING, limits)[0], ""

    def _find_place(self, own: Pose2, target: float) -> tuple[float, float]:
        """The own place on the trail, and the distance to it, metres: the nearest of those around the last one.

        Without a last one, and away from there, the nearest of all up to `target`: a robot that joins does not push in.
        """
        path = self._trail.path
        if self._place is not None:
            place = path.project(own.x, own.y, self._place - _BACK, self._place + _AHEAD)
            off = _distance(own, path.at(place))
            if off <= OFF + self._detour.swing:
                self._place = place
                return place, off
        place = path.project(own.x, own.y, path.start, max(target, path.start))
        off = _distance(own, path.at(place))
        self._place = place if off <= OFF else None
        return place, off

    def _parks(self, error: float) -> bool:
        """Whether it stands at its place behind a head that stands."""
        self._is_parked = self._trail.stands and error < (LEFT if self._is_parked else PARKED)
        return self._is_parked


def _metres_before(head: Pose2, pose: Pose2) -> float:
    """How far a pose lies on the side to which the head looks; negative behind it."""
    return math.cos(head.yaw) * (pose.x - head.x) + math.sin(head.yaw) * (pose.y - head.y)


def _distance(a: Pose2, b: Pose2) -> float:
    return math.hypot(a.x - b.x, a.y - b.y)
