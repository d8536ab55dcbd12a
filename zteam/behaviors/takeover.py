"""Lead a chain in the place of its head that is gone."""

import math
from collections.abc import Iterable
from typing import Any, Literal

from zteam import names
from zteam.behaviors.avoid import Avoid
from zteam.behaviors.behavior import Behavior
from zteam.behaviors.detour import REACH, Detour, find_standing
from zteam.behaviors.forward import Forward
from zteam.behaviors.idle import Idle
from zteam.behaviors.polyline import Polyline
from zteam.behaviors.pursuit import LOOK_AHEAD, Limits, pursue
from zteam.behaviors.view import View
from zteam.behaviors.wander import Wander
from zteam.clock import to_ns
from zteam.geometry import Pose2
from zteam.messages import Twist

Successor = Literal["same", "idle", "forward", "avoid", "wander"]
SUCCESSORS: dict[Any, type[Behavior]] = {"idle": Idle, "forward": Forward, "avoid": Avoid, "wander": Wander}
"""What a robot can go on with that takes over: they need no parameters and no further inputs."""
SPEED = 0.4
"""m/s, at most, on the way that is left of the lost head."""
BEYOND = REACH + 0.6
"""Metres past the lost head to which it drives: it is straight ahead again there."""
ARRIVED = 0.1
"""Metres to the end of that way at which it is done."""
PROGRESS = 0.05
"""Metres that count as getting on."""
PATIENCE = to_ns(3.0)
"""Nanoseconds without getting on after which it goes on from where it is: the way may end at a wall."""
_STEP = 0.1
"""Metres between two points of the way."""


class Takeover:
    """Drive to where the head stands, past it, and go on with a behaviour from there."""

    def __init__(self, trail: Polyline, head: Pose2 | None, then: str) -> None:
        """`trail` is where the head drove, `head` where it stands, both in map, as far as that is known.

        `then` is what comes afterwards, of SUCCESSORS; anything else stands for `avoid`.
        """
        kind = SUCCESSORS.get(then, Avoid)
        self._then = kind(kind.Params())
        self._trail, self._head = trail, head
        self._way = Polyline()
        self._place = 0.0
        """On the way."""
        self._got_on = 0, -math.inf
        """When it got on last (ns), and to which place."""
        self._is_there = False
        self._detour = Detour()

    def step(self, view: View, gone: Iterable[int], max_linear: float, max_angular: float) -> tuple[Twist, str]:
        """The velocity, and why it is zero. `gone` are the robots that may stand in the way."""
        own = view.map_from_base()
        if own is None or not all(map(math.isfinite, own[0])):
            return Twist(), f"its own pose in {names.MAP_FRAME} is not known"
        self._is_there = self._is_there or self._head is None or self._has_arrived(own[0], self._head, view.now)
        if self._is_there:
            return self._then.step(view), self._then.reason
        bent = self._detour.bend(view, self._way, self._place, find_standing(view, gone))
        limits = Limits(max_linear, max_angular)
        if bent is None:
            return pursue(own[0], self._way, self._place, SPEED, limits), ""
        return pursue(own[0], bent, bent.project(*own[0][:2]), SPEED, limits), ""

    def _has_arrived(self, own: Pose2, head: Pose2, now: int) -> bool:
        """Whether it is at the end of the way, or gets on no more: the way may end at a wall."""
        if not len(self._way):
            self._way = self._find_way(own, head)
        self._place = self._way.project(own.x, own.y, self._place, self._place + 2.0 * LOOK_AHEAD)
        since, before = self._got_on
        if self._place > before + PROGRESS:
            self._got_on = now, self._place
        elif now - since > PATIENCE:
            return True
        return self._way.end - self._place <= ARRIVED

    def _find_way(self, own: Pose2, head: Pose2) -> Polyline:
        """From where the robot is along the trail, and over the last metres straight to where the head was heading."""
        trail, way = self._trail, Polyline([own[:2]])
        place = trail.project(own.x, own.y) + _STEP if len(trail) else math.inf
        while place < trail.end - REACH:
            way.append(*trail.at(place)[:2])
            place += _STEP
        way.append(*head.compose(Pose2(BEYOND, 0.0, 0.0))[:2])
        return way
