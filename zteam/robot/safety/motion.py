"""What a base is to the safety layer: the hull of its outline, and its limits.

The outline counts as convex: its hull is some half-planes, and a point's depth in the hull is the largest of its
distances from them (below 0 inside). `kernels/safety.c` has what follows from that.
"""

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from zteam.geometry import Point2, Velocity, convex_hull
from zteam.kernels.binding import ffi, lib, memory
from zteam.messages import Twist, Vector3
from zteam.messages.base import Base

Floats = NDArray[np.float64]

_MOST = 48
"""Points of a side, at most."""
_EDGE = 0.1
"""Metres between points of an outline, at most."""


class Outline:
    """The convex hull of a footprint, in `base_footprint`."""

    def __init__(self, footprint: tuple[Point2, ...]) -> None:
        corners = np.array(convex_hull(footprint))
        self.corners = corners
        """(n, 2), counter-clockwise."""
        along = np.roll(corners, -1, axis=0) - corners
        along /= np.hypot(along[:, 0], along[:, 1])[:, None]
        sides = np.column_stack((along[:, 1], -along[:, 0]))
        tips = sides + np.roll(sides, 1, axis=0)
        normals, at = np.vstack((sides, tips / np.hypot(*tips.T)[:, None])), np.vstack((corners, corners))
        self.rows: Floats = np.column_stack((normals, (normals * at).sum(axis=1)))
        """(n, 3): outward normals of length 1, offsets (inside, normal @ point is less). Of sides and at corners:
        beside a right angle a distance is then less than 8 % too little, and not 29 %."""
        self.radius = float(np.hypot(corners[:, 0], corners[:, 1]).max())
        """Metres from the origin to the furthest corner."""
        self.border = _border(corners)
        """(2, m): points on the outline, at most _EDGE apart."""


outline_of = lru_cache(maxsize=256)(Outline)
"""The outline of a footprint: the same object for equal ones."""


def _border(corners: Floats) -> Floats:
    parts = []
    for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        count = min(_MOST, math.ceil(float(np.hypot(*(end - start))) / _EDGE))
        parts.append(start[:, None] + (end - start)[:, None] * (np.arange(count) / count))
    return np.hstack(parts)


BRAKING = 1.0
"""m/s²: how hard a base counts as braking that tells no limit: none stops at once. `wander` counts on the same."""
TURN_BRAKING = 3.2
"""rad/s², likewise: a stop from the fastest turn of an erratic in a second."""
TOO_FAST = 3.0
"""Times its base's limit of speed: a teammate that seems faster was set down elsewhere."""
_WHEELBASE_SHARE = 0.5
"""Of the outline's length: the wheelbase of a car that does not tell it. Shorter turns more sharply."""


class BaseLimits:
    """The limits of one base. Motions are what the base does; a car's command is an angle of its wheels instead."""

    def __init__(self, base: Base) -> None:
        hull, reach = outline_of(base.footprint), [x for x, _ in base.footprint]
        self.wheelbase = base.wheelbase or _WHEELBASE_SHARE * (max(reach) - min(reach))
        """Metres from axle to axle of a car."""
        is_omni, back = base.drive == "omni", base.decel_lim_reverse
        loss = -base.decel_lim_x, back if math.isfinite(back) else -base.decel_lim_x
        bounds = base.acc_lim_x, base.decel_lim_x, back, base.acc_lim_y, base.acc_lim_theta
        braking = [each if math.isfinite(each) else BRAKING for each in (*loss, base.acc_lim_y)]
        self._hull, sides, tips, edge = hull, len(hull.rows), len(hull.corners), hull.border.shape[1]
        self.struct = ffi.new("base_limits *", {
            "planes": memory("rows", hull.rows, sides, 3), "sides": sides,
            "corners": memory("corners", hull.corners, tips, 2), "tips": tips,
            "border": memory("border", hull.border, 2, edge), "edge": edge,
            "radius": hull.radius, "wheelbase": self.wheelbase, "is_car": base.drive == "car",
            "low": base.min_vel_x, "high": base.max_vel_x, "aside": base.max_vel_y if is_omni else 0.0,
            "turn": base.max_vel_theta, "swerve": base.acc_lim_y, "spin": base.acc_lim_theta, "loss": loss,
            # Backwards a base gains speed no harder than it brakes forwards: that is the simulator's bound.
            "gain": (base.acc_lim_x, min(base.acc_lim_x, -base.decel_lim_x)), "braking": braking[:2],
            "aside_braking": braking[2], "least_braking": min(braking if is_omni else braking[:2]),
            "turn_braking": base.acc_lim_theta if math.isfinite(base.acc_lim_theta) else TURN_BRAKING,
            "too_fast": TOO_FAST * max(base.max_vel_x, base.max_vel_y), "accelerates": any(map(math.isfinite, bounds)),
        })  # fmt: skip
        """For C, as kernels.h has it. It needs the arrays of the hull."""

    def motion_of(self, wanted: Twist) -> Velocity | None:
        """What the base makes of a command within its limits of speed; None if that is no number."""
        motion = ffi.new("double[3]")
        is_number = lib.motion_of(self.struct, (wanted.linear.x, wanted.linear.y, wanted.angular.z), motion)
        return Velocity(*motion) if is_number else None

    def command_of(self, motion: Velocity) -> Twist:
        """The command that makes the base do this."""
        command = ffi.new("double[3]")
        lib.command_of(self.struct, motion, command)
        return twist_of(*command)

    def meeting_time(self, motion: Velocity, seconds: float, points: Floats, clearance: float = 0.0) -> float:
        """When within `seconds` the base first comes nearer to a point of (2, n) than the margin and `clearance` (m).

        inf if it does not. Where it is nearer to a point than that now, what counts is when it comes nearer still to
        that one, or as near to another: so a base may always move away, and along a wall.
        """
        count = points.shape[1]
        return float(lib.meet(self.struct, motion, seconds, clearance, memory("points", points, 2, count), count))


def twist_of(x: float, y: float, turn: float) -> Twist:
    """A command in the plane (m/s, m/s, rad/s)."""
    return Twist(Vector3(x, y), Vector3(0.0, 0.0, turn))


limits_of = lru_cache(maxsize=256)(BaseLimits)
"""The limits of a base: worked out once, for a robot looks at those of its teammates in each step."""


NO_NUMBER = "the driver asks for a velocity that is no number"


def limit_speed(wanted: Twist, base: Base) -> tuple[Twist, str]:
    """Without the safety layer: `wanted` within the limits of speed, and why it was cut ("" = it was not)."""
    limits = limits_of(base)
    motion = limits.motion_of(wanted)
    return (Twist(), NO_NUMBER) if motion is None else (limits.command_of(motion), "")
