"""Where the teammates are, and will be until they stand: the laser looks over low bodies, and lasers dazzle each other.

A look-up costs a few microseconds, and a team may have dozens of robots. So a teammate that is far away is looked up
again only when it may have come near, both driving as fast as any robot may.
"""

import math
from collections.abc import Mapping
from functools import cached_property

import msgspec
import numpy as np
from numpy.typing import NDArray

from zteam import names
from zteam.base import DEFAULT_BASE, Base
from zteam.behaviors.nearby import cannot_meet_before
from zteam.behaviors.safety.limits import BRAKING
from zteam.behaviors.safety.swept import DRIVE_MARGIN, Box, Outline, outline_of
from zteam.behaviors.view import View
from zteam.clock import to_ns
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
FORGET_AFTER = to_ns(5.0)
"""Nanoseconds after which a pose says nothing any more: the robot was taken away, or its transforms never come."""
LOOK_AGAIN = to_ns(1.0)
"""Nanoseconds until a teammate is looked up again that has no pose."""
TOO_FAST = 3.0
"""m/s: a teammate that seems faster was set down elsewhere."""
HORIZON = 1.6
"""Metres between the circles of two robots from which on they cannot meet before both stand, whatever they do: twice
the way in one tick (0.1 m) and the braking distance (0.5 m) at 1 m/s, and GAP, and a margin."""
_STEP = 0.2
"""Metres between two outlines of a teammate on its way, at most: less than the length of any robot."""


class Near(msgspec.Struct, frozen=True, dict=True):
    """A teammate that may be in the way, and what it takes up until it stands."""

    robot_id: int
    outline: Outline
    at: Pose2
    """In the base frame of the robot that looks."""
    velocity: tuple[float, float]
    """m/s, in that frame."""
    way: float
    """Metres that it drives until it stands; 0 for one that drives away: it comes no nearer, should it stop at once."""
    gap: float
    """Metres to stop before it."""
    clearance: float
    """Metres that its outline has grown."""

    def may_be_in(self, box: Box) -> bool:
        """Whether what it takes up may reach into a box of the base frame."""
        return box.away(self.at.x, self.at.y) <= self.outline.radius + self.way + self.clearance

    @cached_property
    def points(self) -> Floats:
        """(2, n): its border on the whole way, in the base frame of the robot that looks."""
        cos, sin = math.cos(self.at.yaw), math.sin(self.at.yaw)
        x, y = self.outline.border
        border = np.array((self.at.x + cos * x - sin * y, self.at.y + sin * x + cos * y))
        if not self.way:
            return border
        count = math.ceil(self.way / _STEP)
        times = np.arange(count + 1) * (self.way / count / math.hypot(*self.velocity))
        points: Floats = border[:, :, None] + np.array(self.velocity)[:, None, None] * times
        return points.reshape(2, -1)


class _Teammate:
    """What is known of one teammate."""

    def __init__(self, robot_id: int, outline: Outline) -> None:
        self.robot_id = robot_id
        self.outline = outline
        self.frame = names.robot_frame(robot_id, names.BASE_FOOTPRINT)
        self.pose: Pose2 | None = None
        """In `map`."""
        self.stamp = 0
        self.velocity = 0.0, 0.0
        """m/s, in `map`."""
        self.way = 0.0
        """Metres that it drives from its known pose until it stands, if it brakes a tick from now on."""
        self.growth = 0.0
        """Metres that its outline has grown."""
        self.due = 0
        """Time at which it is looked up again (ns)."""

    def take(self, pose: Pose2, stamp: int, now: int) -> None:
        """It was at `pose` in `map` at `stamp` (ns; 0 = it never moves), and it is `now` (ns)."""
        last, seconds = self.pose, (stamp - self.stamp) / 1e9
        if last is None or seconds < 0.0 or not stamp:
            self.velocity = 0.0, 0.0
        elif seconds > 0.0:
            vx, vy = (pose.x - last.x) / seconds, (pose.y - last.y) / seconds
            self.velocity = (vx, vy) if math.hypot(vx, vy) <= TOO_FAST else (0.0, 0.0)
        self.pose, self.stamp = pose, stamp
        speed, age = math.hypot(*self.velocity), max(0.0, (now - stamp) / 1e9) if stamp else 0.0
        self.way = speed * (age + 0.1) + 0.5 * speed * speed / BRAKING
        late = age - GRACE
        self.growth = min(MAX_GROWTH, late * max(speed, GROWTH)) if late > 0.0 else 0.0


class Teammates:
    """Tracks the teammates of one robot."""

    def __init__(self) -> None:
        self._known: dict[int, _Teammate] = {}
        self._sources: tuple[Mapping[int, Base], tuple[int, ...]] | tuple[None, None] = (None, None)
        """What the ids came from."""
        self._due = 0
        """Time at which the first is due (ns)."""

    def are_due(self, view: View) -> bool:
        """Whether some teammate may have come near. Mostly this compares one number."""
        if self._sources[0] is not view.bases or self._sources[1] != view.team:
            self._take_ids(view)
        return view.now >= self._due

    def bearings(self, view: View) -> list[tuple[float, float]]:
        """Where all teammates are whose pose is fresh, as (x, y) in the base frame."""
        found = (view.base_from_robot(robot_id) for robot_id in self._known)
        return [(at[0].x, at[0].y) for at in found if at and (not at[1] or view.is_fresh(at[1], 0.5))]

    def _take_ids(self, view: View) -> None:
        self._sources = view.bases, view.team
        ids = sorted({*view.bases, *view.team} - {view.robot_id})
        for i in ids:
            outline = outline_of(view.bases.get(i, DEFAULT_BASE))
            mate = self._known.setdefault(i, _Teammate(i, outline))
            mate.outline = outline
        self._known = {i: self._known[i] for i in ids}
        self._due = 0 if ids else 1 << 62

    def look(self, view: View, outline: Outline, reach: float) -> list[Near]:
        """The teammates that a robot of this outline may meet that needs `reach` metres to stop GAP before something.

        Ask `are_due` before.
        """
        own = view.map_from_base()
        if own is None or not all(map(math.isfinite, own[0])):
            self._due = view.now + LOOK_AGAIN
            return []
        found, due, now = [], 1 << 62, view.now
        for mate in self._known.values():
            if now >= mate.due:
                away = self._look_up(view, mate, own[0], outline.radius + mate.outline.radius)
                # The gap is part of the reach.
                left = away - reach - DRIVE_MARGIN
                if left <= 0.0 or left <= mate.way + mate.growth:
                    found.append(mate)
            if mate.due < due:
                due = mate.due
        self._due = due
        return _nearby(found, own[0]) if found else []

    def _look_up(self, view: View, mate: _Teammate, own: Pose2, radii: float) -> float:
        """Look a teammate up: metres between the circles of both robots, inf if it is not known where it is."""
        found = view.lookup(names.MAP_FRAME, mate.frame)
        old = found is not None and found[1] and view.now - found[1] > FORGET_AFTER
        if found is None or old or not math.isfinite(sum(found[0])):
            mate.pose, mate.due = None, view.now + LOOK_AGAIN
            return math.inf
        mate.take(*found, view.now)
        away = math.hypot(found[0].x - own.x, found[0].y - own.y) - radii
        mate.due = cannot_meet_before(view.now, away - HORIZON)
        return away


def _nearby(mates: list[_Teammate], own: Pose2) -> list[Near]:
    """Teammates, seen from the pose `own` in `map`."""
    base_from_map, cos, sin = own.inverse(), math.cos(own.yaw), math.sin(own.yaw)
    found = []
    for mate in mates:
        assert mate.pose is not None
        at, velocity = base_from_map.compose(mate.pose), mate.velocity
        vx, vy = cos * velocity[0] + sin * velocity[1], cos * velocity[1] - sin * velocity[0]
        recedes = vx * at.x + vy * at.y > RECEDES * math.hypot(at.x, at.y)
        gap, way = (FOLLOWING_GAP, 0.0) if recedes else (GAP, mate.way)
        found.append(Near(mate.robot_id, mate.outline, at, (vx, vy), way, gap, mate.growth))
    return found
