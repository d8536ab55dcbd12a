"""How the robots of a line make room behind a head that keeps its place, and that may turn back into its line."""

import math

from zteam.behaviors.around import Around
from zteam.behaviors.escape import Escape
from zteam.behaviors.head import Head
from zteam.behaviors.line import Place
from zteam.behaviors.polyline import Polyline
from zteam.behaviors.pursuit import LOOK_AHEAD, Limits
from zteam.behaviors.view import View
from zteam.clock import to_ns
from zteam.geometry import Pose2
from zteam.messages import Twist, Vector3

NEAR, MET = 0.58, 1.0
"""Metres from base to base within which a robot drives back from the one ahead; and where that one comes towards it."""
BESIDE = 0.4
"""Metres beside each other up to which two robots that come towards each other cannot pass."""
BACK_SPEED = 0.2
"""m/s at which it drives back."""
FACING, FACED = 1.2, 2.0
"""Metres from the head within which a robot begins to stand face to face with it, and beyond which it does no more."""
FACED_FOR = to_ns(4.0)
"""Nanoseconds face to face after which it drives round the head to its place behind it, because that cannot get on."""
STUCK, STUCK_FOR = 0.2, to_ns(3.0)
"""Metres, and nanoseconds: a robot that is late and has not come so far in so long leaves its trail."""
FREED = 0.5
"""Metres from there after which it takes its trail again."""
STRAY, STRAY_TURN = 0.4, 1.0
"""m/s and rad/s while it is off its trail."""


class Stray:
    """Takes a robot that is late and stuck off its way: there it drives as a head does."""

    def __init__(self) -> None:
        self._head = Head()
        self._anchor = (0.0, 0.0), 0
        """Where it got on last, and when (ns)."""

    def step(self, view: View, own: Pose2, limits: Limits, *, is_late: bool) -> Twist | None:
        """The velocity of a robot at `own` in map; None to go its way.

        `is_late`: it is to drive on, and does not wait for another robot.
        """
        place, since = self._anchor
        is_stuck = view.now - since > STUCK_FOR
        if math.dist(own[:2], place) > (FREED if is_stuck else STUCK) or not is_late:
            self._anchor = own[:2], view.now
        if is_stuck:
            linear, angular = min(STRAY, limits.linear), min(STRAY_TURN, limits.angular)
            command, _ = self._head.step(view, own, Place(), linear, angular)
            if command is not None:
                return command
            self._anchor = own[:2], view.now
        self._head.rest()
        return None


class MakingRoom:
    """What a robot does instead of following: it goes round a head that faces it, or strays."""

    def __init__(self) -> None:
        self._around, self._escape, self._stray = Around(), Escape(), Stray()
        self._faced_since: int | None = None
        """Nanoseconds: since when it stands face to face with the head."""

    def step(
        self, view: View, own: Pose2, head: Pose2 | None, back: float, limits: Limits, *, is_late: bool
    ) -> Twist | None:
        """The velocity of a robot at `own`, whose place is `back` metres behind the head; None to follow.

        Poses are in map. `head` is None where the head hands over instead.
        """
        if head is not None and self._is_faced(view, own, head):
            x, y, _ = own.inverse().compose(head).compose(Pose2(-back, 0.0, 0.0))
            return self._escape.free(view, own, self._around.drive_to(view, x, y, limits))
        return self._stray.step(view, own, limits, is_late=is_late)

    def _is_faced(self, view: View, own: Pose2, head: Pose2) -> bool:
        apart = math.dist(own[:2], head[:2])
        if apart > FACED or head.inverse().compose(own).x <= 0.0:
            self._faced_since = None
        elif self._faced_since is None and own.inverse().compose(head).x > 0.0 and apart < FACING:
            self._faced_since = view.now
        return self._faced_since is not None and view.now - self._faced_since > FACED_FOR


def is_too_near(ahead: Pose2) -> bool:
    """Whether a robot has to drive back from the one at `ahead` (own base frame)."""
    back = ahead.inverse()
    is_met = back.x > 0.0 and max(abs(ahead.y), abs(back.y)) < BESIDE
    return ahead.x > 0.0 and math.hypot(ahead.x, ahead.y) < (MET if is_met else NEAR)


def back_up(own: Pose2, path: Polyline, place: float) -> Twist:
    """The velocity back along the way behind `place`."""
    target = own.inverse().compose(path.at(place - LOOK_AHEAD))
    square = target.x * target.x + target.y * target.y
    if target.x >= 0.0 or square < 1e-4:
        return Twist(Vector3(-BACK_SPEED))
    # The arc through the robot and the target, as in pursuit.
    turn = -BACK_SPEED * 2.0 * target.y / square
    return Twist(Vector3(-BACK_SPEED), Vector3(z=max(-1.0, min(1.0, turn))))
