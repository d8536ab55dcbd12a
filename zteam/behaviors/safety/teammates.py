"""Where teammates are, and will be until they stand: the laser looks over low bodies, and lasers dazzle each other."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from zteam import names
from zteam.base import DEFAULT_BASE, Base
from zteam.behaviors.safety.limits import limits_of
from zteam.behaviors.safety.swept import outline_of
from zteam.behaviors.view import View
from zteam.geometry import Pose2

Floats = NDArray[np.float64]

GAP = 0.3
"""Metres that two robots stop apart, outline to outline."""
FOLLOWING_GAP = 0.1
"""Metres to a teammate that drives away: a chain at 0.8 m from base to base has 0.45 m between two erratics."""
RECEDES = 0.05
"""m/s away from the robot from which on a teammate drives away."""
GRACE = 0.3
"""Seconds that a pose may be old for nothing: transforms come over the aggregator. Then its outline grows."""
GROWTH = 0.25
"""m/s at which the outline of a teammate grows whose pose is old, or its own speed if that is more."""
MAX_GROWTH = 0.5
"""Metres."""
FORGET_AFTER = 5.0
"""Seconds after which a pose says nothing any more: the robot was taken away, or its transforms never come."""
TOO_FAST = 3.0
"""Times its base's limit of speed: a teammate that seems faster was set down elsewhere."""
_STEP = 0.2
"""Metres between two outlines of a teammate on its way, at most: less than the length of any robot."""


class Near(NamedTuple):
    """A teammate that may be in the way."""

    robot_id: int
    points: Floats
    """(2, n): its border on all its way until it stands, in the base frame of the robot that looks."""
    gap: float
    """Metres to stop before it."""
    clearance: float
    """Metres that its outline has grown."""


class _Teammate:
    """What is known of one teammate."""

    def __init__(self, robot_id: int, base: Base) -> None:
        self.robot_id, self.base, self.frame = robot_id, base, names.robot_frame(robot_id, names.BASE_FOOTPRINT)
        self.outline, self.braking = outline_of(base), limits_of(base).least_braking
        self._too_fast = TOO_FAST * max(base.max_vel_x, base.max_vel_y)
        self.pose: Pose2 | None = None
        """In `map`."""
        self.stamp, self.age, self.x, self.y, self.speed = 0, 0.0, 0.0, 0.0, 0.0
        """When it was there (ns; 0 = it never moves), how many seconds ago, and how fast, in `map` (m/s)."""

    def take(self, pose: Pose2, stamp: int, age: float) -> None:
        """It was at `pose`, so many seconds ago."""
        last, seconds = self.pose, (stamp - self.stamp) / 1e9
        if last is None or seconds < 0.0 or not stamp:
            self.x = self.y = self.speed = 0.0
        elif seconds > 0.0:
            self.x, self.y = (pose.x - last.x) / seconds, (pose.y - last.y) / seconds
            self.speed = math.hypot(self.x, self.y)
            if self.speed > self._too_fast:
                self.x = self.y = self.speed = 0.0
        self.pose, self.stamp, self.age = pose, stamp, age


class Teammates:
    """Tracks the teammates of one robot."""

    def __init__(self) -> None:
        self._known: dict[int, _Teammate] = {}
        self._sources: tuple[object, object] = (None, None)
        """What the ids came from."""
        self._here: Pose2 | None = None
        """Of the robot in `map`, in this step."""

    def look(self, view: View) -> None:
        """See where all are now."""
        if self._sources[0] is not view.bases or self._sources[1] != view.team:
            self._sources = view.bases, view.team
            ids = sorted({*view.bases, *view.team} - {view.robot_id})
            bases, known = {i: view.bases.get(i, DEFAULT_BASE) for i in ids}, self._known
            is_same = {i: i in known and known[i].base is base for i, base in bases.items()}
            self._known = {i: known[i] if is_same[i] else _Teammate(i, base) for i, base in bases.items()}
        own = view.map_from_base()
        self._here = own[0] if own is not None and math.isfinite(sum(own[0])) else None
        for mate in self._known.values():
            at = view.lookup(names.MAP_FRAME, mate.frame)
            age = (view.now - at[1]) / 1e9 if at is not None and at[1] else 0.0
            if at is None or age > FORGET_AFTER or not math.isfinite(sum(at[0])):
                mate.pose = None
            else:
                mate.take(*at, max(0.0, age))

    def near(self, x: float, y: float, radius: float, reaction: float) -> list[Near]:
        """The teammates that may come into a disc of the base frame until they stand, in metres.

        They begin to brake `reaction` seconds from now.
        """
        here, found = self._here, []
        if here is None or not self._known:
            return []
        x, y, _ = here.compose(Pose2(x, y, 0.0))
        for mate in self._known.values():
            if mate.pose is not None:
                speed, age = mate.speed, mate.age
                way = speed * (age + reaction + 0.5 * speed / mate.braking)
                growth = 0.0 if age <= GRACE else min(MAX_GROWTH, (age - GRACE) * max(speed, GROWTH))
                away = math.hypot(mate.pose.x - x, mate.pose.y - y) - mate.outline.radius
                if away <= radius + way + growth:
                    found.append(_near(mate, here.inverse().compose(mate.pose), here.yaw, way, growth))
        return found

    def bearings(self, view: View) -> list[tuple[float, float]]:
        """Where all teammates are whose pose is fresh, as (x, y) in the base frame."""
        found = (view.base_from_robot(robot_id) for robot_id in self._known)
        return [(at[0].x, at[0].y) for at in found if at and (not at[1] or view.is_fresh(at[1], 0.5))]


def _near(mate: _Teammate, at: Pose2, yaw: float, way: float, growth: float) -> Near:
    """A teammate that is at a pose of the base frame; the base is turned by `yaw` in `map`."""
    cos, sin = math.cos(yaw), math.sin(yaw)
    vx, vy = cos * mate.x + sin * mate.y, cos * mate.y - sin * mate.x
    cos, sin, (x, y) = math.cos(at.yaw), math.sin(at.yaw), mate.outline.border
    border = np.array((at.x + cos * x - sin * y, at.y + sin * x + cos * y))
    if vx * at.x + vy * at.y > RECEDES * math.hypot(at.x, at.y):
        # It comes no nearer, should it stop at once.
        return Near(mate.robot_id, border, FOLLOWING_GAP, growth)
    if way:
        count = math.ceil(way / _STEP)
        seconds = np.arange(count + 1) * (way / count / math.hypot(vx, vy))
        border = (border[:, :, None] + np.array((vx, vy))[:, None, None] * seconds).reshape(2, -1)
    return Near(mate.robot_id, border, GAP, growth)
