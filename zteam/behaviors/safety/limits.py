"""How fast a base may go and how fast its speed may change."""

import math
from typing import NamedTuple

from zteam.base import Base
from zteam.behaviors.view import View
from zteam.messages import Twist, Vector3

NO_NUMBER = "the driver asks for a velocity that is no number"
MAX_LINEAR = 1.0
"""m/s, forwards and backwards, also for a base that could go faster: Stage's own limit for a position model."""
MAX_ANGULAR = math.pi
"""rad/s, both ways, likewise."""
BRAKING = 1.0
"""m/s²: how hard a base counts as braking that tells no limit: none stops at once. `wander` counts on the same."""
TURN_BRAKING = 3.2
"""rad/s², likewise: a stop from the fastest turn in a second."""
STOPPING, TURN_STOPPING = 2.5, 8.0
"""m/s² and rad/s²: how hard such a base is made to stop when data is old or a leader is gone: it stands within 0.4 s,
and so within 0.5 s of the loss."""
LEAST = 1e-6
"""m/s and rad/s: no base moves so slowly, and a way divided by less would be no number."""
_WHEELBASE_SHARE = 0.5
"""Of the outline's length: the wheelbase of a car, which `base_info` does not tell. Shorter turns more sharply."""


class Motion(NamedTuple):
    """A velocity of the base that is kept: an arc, a straight line or a turn on the spot."""

    x: float
    """m/s."""
    turn: float
    """rad/s; of a car the angle of its wheels, radians."""


STANDING = Motion(0.0, 0.0)


class Limits:
    """The limits of one base."""

    def __init__(self, base: Base) -> None:
        self._base = base
        self._is_car = base.drive == "car"
        # A car's command is an angle of its wheels.
        self._max_turn = MAX_ANGULAR if self._is_car else min(MAX_ANGULAR, base.max_vel_theta)
        self._least, self._most = max(-MAX_LINEAR, base.min_vel_x), min(MAX_LINEAR, base.max_vel_x)
        self._has_accelerations = any(map(math.isfinite, (base.acc_lim_x, base.decel_lim_x, base.acc_lim_theta)))
        self.braking = -base.decel_lim_x if math.isfinite(base.decel_lim_x) else BRAKING
        """m/s²."""
        self.turn_braking = base.acc_lim_theta if math.isfinite(base.acc_lim_theta) else TURN_BRAKING
        """rad/s²."""
        reach = [x for x, _ in base.footprint]
        self._wheelbase = _WHEELBASE_SHARE * (max(reach) - min(reach))

    def clamp(self, wanted: Motion) -> Motion:
        """`wanted` within the limits of speed; what is less than LEAST is 0."""
        x = wanted.x if abs(wanted.x) >= LEAST else 0.0
        turn = wanted.turn if abs(wanted.turn) >= LEAST else 0.0
        return Motion(max(self._least, min(self._most, x)), max(-self._max_turn, min(self._max_turn, turn)))

    def approach(self, wanted: Motion, last: Motion, seconds: float) -> Motion:
        """What comes of `wanted` in `seconds` within the limits of acceleration, if the base has any."""
        if not self._has_accelerations:
            return wanted
        x = _approach(wanted.x, last.x, self._base.acc_lim_x * seconds, -self._base.decel_lim_x * seconds)
        if self._is_car:
            return Motion(x, wanted.turn)
        change = self._base.acc_lim_theta * seconds
        return Motion(x, _approach(wanted.turn, last.turn, change, change))

    def brake(self, last: Motion, seconds: float) -> Motion:
        """The motion after braking for `seconds`: along the same arc, as hard as both parts can."""
        longest = self.stop_time(last) if self._has_accelerations else self._time(last, STOPPING, TURN_STOPPING)
        left = 1.0 - seconds / longest if longest > seconds else 0.0
        return Motion(left * last.x, last.turn if self._is_car and left else left * last.turn)

    def stop_time(self, motion: Motion) -> float:
        """Seconds that braking along the arc takes."""
        return self._time(motion, self.braking, self.turn_braking)

    def _time(self, motion: Motion, braking: float, turn_braking: float) -> float:
        straight = abs(motion.x) / braking
        return straight if self._is_car else max(straight, abs(motion.turn) / turn_braking)

    def arc(self, motion: Motion) -> tuple[float, float]:
        """Speed and yaw rate of the base: m/s and rad/s."""
        if not self._is_car:
            return motion
        return motion.x * math.cos(motion.turn), motion.x * math.sin(motion.turn) / self._wheelbase

    def scale(self, motion: Motion, share: float) -> Motion:
        """The same arc, driven at a share of its speed."""
        return Motion(motion.x * share, motion.turn if self._is_car else motion.turn * share)


class LimitsOnly:
    """What is left without the safety layer: the limits of the base, and numbers that are numbers."""

    def limit(self, wanted: Twist, view: View, reason: str = "") -> tuple[Twist, str]:
        """`wanted` within the limits of speed, and why it was cut ("" = it was not)."""
        x, turn = wanted.linear.x, wanted.angular.z
        if not (math.isfinite(x) and math.isfinite(turn)):
            return Twist(), NO_NUMBER
        motion = Limits(view.base).clamp(Motion(float(x), float(turn)))
        return Twist(Vector3(motion.x), Vector3(0.0, 0.0, motion.turn)), ""


def _approach(wanted: float, last: float, gain: float, loss: float) -> float:
    """`wanted`, but at most `gain` faster and `loss` slower than `last`; turning round means losing speed first."""
    if wanted * last < 0.0:
        left = abs(last) - loss
        return math.copysign(left, last) if left > 0.0 else math.copysign(min(abs(wanted), gain), wanted)
    size = min(max(abs(wanted), abs(last) - loss), abs(last) + gain)
    return math.copysign(size, last if wanted == 0.0 else wanted)
