"""How a formation makes way for a leader that it has boxed in: in a dead end, or where the leader turns back."""

import math

from zteam.behaviors.around import Around
from zteam.behaviors.line_room import MOVED, BoxedIn
from zteam.behaviors.pursuit import Limits
from zteam.behaviors.view import View
from zteam.geometry import Pose2
from zteam.messages import Twist

ROOM, BESIDE = 1.6, 0.75
"""Metres that it gets ahead, and on either side of its way."""
STEP = 1.5
"""Metres to the place that a robot drives to: it goes on from there as long as it has to."""


class MakingWay:
    """Drives off until the leader has room, and then aside as long as the leader comes towards it."""

    def __init__(self) -> None:
        self._boxed_in = BoxedIn()
        self._is_asked = False
        self._around = Around()

    def forget(self) -> None:
        """The leader is not seen."""
        self._boxed_in, self._is_asked = BoxedIn(), False

    def step(self, view: View, here: Pose2, leader: Pose2, limits: Limits) -> Twist | None:
        """The velocity of a robot that is in the way; None for one that is not. Poses are in map."""
        is_boxed = self._boxed_in.look(view.now, leader)
        if not is_boxed and not self._is_asked:
            return None
        x, y, yaw = leader.inverse().compose(here)
        apart, at = math.hypot(x, y), here.inverse().compose(leader)
        nearer = sum(math.dist(at[:2], mate.pose[:2]) < apart - MOVED for mate in view.teammates) - 1
        comes = x > 0.0 and abs(y) < BESIDE and apart < 2.0 * ROOM
        self._is_asked = apart < ROOM + BESIDE * max(0, nearer) if is_boxed else comes
        if not self._is_asked:
            return None
        away = math.atan2(y, x) if is_boxed else math.copysign(0.25 * math.pi, y)
        return self._around.drive_to(view, STEP * math.cos(away - yaw), STEP * math.sin(away - yaw), limits)
