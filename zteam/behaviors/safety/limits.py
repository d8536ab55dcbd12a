"""How fast a base may go and how fast its speed may change."""

import math
from functools import lru_cache

from zteam.base import Base
from zteam.behaviors.safety.swept import Motion
from zteam.behaviors.view import View
from zteam.messages import Twist, Vector3

NO_NUMBER = "the driver asks for a velocity that is no number"
BRAKING = 1.0
"""m/s²: how hard a base counts as braking that tells no limit: none stops at once. `wander` counts on the same."""
TURN_BRAKING = 3.2
"""rad/s², likewise: a stop from the fastest turn of an erratic in a second."""
STOPPING, TURN_STOPPING = 2.5, 8.0
"""m/s² and rad/s²: how hard such a base is made to stop when data is old or a leader is gone: an erratic stands within
0.4 s, and so within 0.5 s of the loss."""
LEAST = 1e-6
"""m/s and rad/s: no base moves so slowly, and a way divided by less would be no number."""
_WHEELBASE_SHARE = 0.5
"""Of the outline's length: the wheelbase of a car that does not tell it. Shorter turns more sharply."""
_FASTER = 0.02
"""m/s and rad/s more than commanded that odometry may say for nothing."""

STANDING = Motion(0.0, 0.0)


class Limits:
    """The limits of one base. Motions are what the base does; a car's command is an angle of its wheels instead."""

    def __init__(self, base: Base) -> None:
        self._base = base
        self._is_car, self._is_omni = base.drive == "car", base.drive == "omni"
        self.turns_apart = not self._is_car
        """Whether the base can turn as it likes while it drives more slowly."""
        reach = [x for x, _ in base.footprint]
        self._wheelbase = base.wheelbase or _WHEELBASE_SHARE * (max(reach) - min(reach))
        self._most_y = base.max_vel_y if self._is_omni else 0.0
        bounds = base.acc_lim_x, base.decel_lim_x, base.decel_lim_reverse, base.acc_lim_y, base.acc_lim_theta
        self._has_accelerations = any(map(math.isfinite, bounds))
        # Backwards a base gains speed no harder than it brakes forwards: that is the simulator's bound.
        self._gain = base.acc_lim_x, min(base.acc_lim_x, -base.decel_lim_x)
        back = base.decel_lim_reverse if math.isfinite(base.decel_lim_reverse) else -base.decel_lim_x
        self._loss = -base.decel_lim_x, back
        self._braking = tuple(loss if math.isfinite(loss) else BRAKING for loss in self._loss)
        self._side_braking = base.acc_lim_y if math.isfinite(base.acc_lim_y) else BRAKING
        self.least_braking = min(*self._braking, self._side_braking if self._is_omni else math.inf)
        self._turn_braking = base.acc_lim_theta if math.isfinite(base.acc_lim_theta) else TURN_BRAKING

    def motion_of(self, wanted: Twist) -> Motion | None:
        """What the base makes of a command within its limits of speed; None if that is no number."""
        x, turn, y = wanted.linear.x, wanted.angular.z, wanted.linear.y if self._is_omni else 0.0
        if not (math.isfinite(x) and math.isfinite(turn) and math.isfinite(y)):
            return None
        motion = Motion(float(x), float(turn), float(y))
        if self._is_car:
            x = max(self._base.min_vel_x, min(self._base.max_vel_x, motion.x))
            motion = Motion(x * math.cos(motion.turn), x * math.sin(motion.turn) / self._wheelbase)
        return self.clamp(motion)

    def command_of(self, motion: Motion) -> Twist:
        """The command that makes the base do this."""
        x, turn, y = motion
        if self._is_car:
            angle = math.atan2(math.copysign(turn, turn * x) * self._wheelbase, abs(x)) if x else 0.0
            x, turn = math.copysign(math.hypot(x, turn * self._wheelbase), x) if x else 0.0, angle
        return Twist(Vector3(x, y), Vector3(0.0, 0.0, turn))

    def clamp(self, wanted: Motion) -> Motion:
        """`wanted` within the limits of speed; what is less than LEAST is 0."""
        x, turn, y = [part if abs(part) >= LEAST else 0.0 for part in wanted]
        base, most_y = self._base, self._most_y
        x, turn = max(base.min_vel_x, min(base.max_vel_x, x)), max(-base.max_vel_theta, min(base.max_vel_theta, turn))
        return Motion(x, turn, max(-most_y, min(most_y, y)))

    def approach(self, wanted: Motion, last: Motion, seconds: float) -> Motion:
        """What comes of `wanted` in `seconds` within the limits of acceleration, if the base has any."""
        if not self._has_accelerations:
            return wanted
        x = _approach(wanted.x, last.x, self._gain[wanted.x < 0.0] * seconds, self._loss[last.x < 0.0] * seconds)
        turning, sideways = self._base.acc_lim_theta * seconds, self._base.acc_lim_y * seconds
        # The wheels of a car that slows down take its turn with them.
        turn = _approach(wanted.turn, last.turn, turning, math.inf if self._is_car else turning)
        if self._is_car and (x != wanted.x or wanted.turn * last.turn < 0.0):
            # They go through straight on, and are never turned more sharply than was asked for.
            sharpest = abs(wanted.turn * x / wanted.x) if wanted.x and wanted.turn * last.turn >= 0.0 else 0.0
            turn = max(-sharpest, min(sharpest, turn))
        return Motion(x, turn, _approach(wanted.y, last.y, sideways, sideways))

    def brake(self, last: Motion, seconds: float) -> Motion:
        """The motion after braking for `seconds`: along the same arc, as hard as all parts can."""
        if self._has_accelerations:
            longest = self.stop_time(last)
        else:
            straight, turning = last.speed / STOPPING, abs(last.turn) / TURN_STOPPING
            longest = straight if self._is_car else max(straight, turning)
        return last.scale(1.0 - seconds / longest) if longest > seconds else STANDING

    def longest_way(self, reaction: float) -> float:
        """Metres until the base stands that begins to brake `reaction` seconds from now, at most."""
        fastest = max(self._base.max_vel_x, -self._base.min_vel_x, self._most_y)
        return fastest * (reaction + 0.5 * fastest / self.least_braking)

    def stop_time(self, motion: Motion) -> float:
        """Seconds that braking along the arc takes."""
        straight = max(abs(motion.x) / self._braking[motion.x < 0.0], abs(motion.y) / self._side_braking)
        return straight if self._is_car else max(straight, abs(motion.turn) / self._turn_braking)

    def measure(self, told: Motion, view: View) -> Motion | None:
        """The velocity that odometry says, if the base is faster than it was told to be in some part; else None."""
        if view.odom is None:
            return None
        linear, angular = view.odom.twist.twist.linear, view.odom.twist.twist.angular
        x, turn, y = linear.x, angular.z, linear.y if self._is_omni else 0.0
        is_faster = any(abs(a) > abs(b) + _FASTER for a, b in zip((x, turn, y), told, strict=True))
        return Motion(float(x), float(turn), float(y)) if is_faster and math.isfinite(x + turn + y) else None


limits_of = lru_cache(maxsize=256)(Limits)
"""The limits of a base: worked out once, for a robot looks at those of its teammates in each step."""


class LimitsOnly:
    """What is left without the safety layer: the limits of the base, and numbers that are numbers."""

    def limit(self, wanted: Twist, view: View, reason: str = "") -> tuple[Twist, str]:
        """`wanted` within the limits of speed, and why it was cut ("" = it was not)."""
        limits = limits_of(view.base)
        motion = limits.motion_of(wanted)
        return (Twist(), NO_NUMBER) if motion is None else (limits.command_of(motion), "")


def at_least(motion: Motion, measured: Motion | None) -> Motion:
    """`motion`, with each part as large as it is `measured` where the base is faster than it was told to be."""
    if measured is None:
        return motion
    return Motion(*[math.copysign(max(abs(a), abs(b)), a) if a else a for a, b in zip(motion, measured, strict=True)])


def _approach(wanted: float, last: float, gain: float, loss: float) -> float:
    """`wanted`, but at most `gain` faster and `loss` slower than `last`; turning round means losing speed first."""
    if wanted * last < 0.0:
        left = abs(last) - loss
        return math.copysign(left, last) if left > 0.0 else math.copysign(min(abs(wanted), gain), wanted)
    size = min(max(abs(wanted), abs(last) - loss), abs(last) + gain)
    return math.copysign(size, last if wanted == 0.0 else wanted)
