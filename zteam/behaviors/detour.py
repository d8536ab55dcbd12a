"""The way round robots that stand on a path: their processes are gone, and nothing drives them away.

The path is bent beside them, on the side where there is room. Where they stand is known from transforms, because the
laser may look over them.
"""

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import msgspec
import numpy as np

from zteam import names
from zteam.behaviors.polyline import Polyline
from zteam.behaviors.pursuit import LOOK_AHEAD, Limits, pursue
from zteam.behaviors.scans import beams_of
from zteam.behaviors.view import View
from zteam.geometry import Pose2
from zteam.messages import Twist, Vector3

MARGIN = 0.2
"""Metres between the side of the robot that passes and the circle around the one that stands."""
REACH = 1.3
"""Metres of the path before and behind a standing robot in which it swings out and back."""
AHEAD = 2.0
"""Metres of the path ahead that are looked at."""
ROOM = 0.05
"""Metres that have to be free beside the robot that passes."""
BODY = 0.45
"""Metres around another robot within which a hit of the laser is that robot."""
_STEP = 0.1
"""Metres between two points of a bent path."""
_ROUNDING = 1e-6
"""Metres: more than rounding makes of a distance."""


class Standing(msgspec.Struct, frozen=True):
    """A robot that stands: its base in map, and the distance to pass it in, metres from base to base."""

    x: float
    y: float
    distance: float


class _Swing(NamedTuple):
    """How far a path has to be bent, and where."""

    place: float
    """On the path."""
    offset: float
    """Metres to the left."""

    def at(self, place: float) -> float:
        """Metres to the left at this place."""
        off = abs(place - self.place)
        return self.offset * 0.5 * (1.0 + math.cos(math.pi * off / REACH)) if off < REACH else 0.0


def find_standing(view: View, robots: Iterable[int]) -> list[Standing]:
    """Where those of these robots are that have a pose."""
    found = []
    for robot in sorted(robots):
        at = view.lookup(names.MAP_FRAME, names.robot_frame(robot, names.BASE_FOOTPRINT))
        if at is not None and all(map(math.isfinite, at[0])):
            radius = view.bases[robot].radius if robot in view.bases else view.base.radius
            found.append(Standing(at[0].x, at[0].y, view.base.half_width + radius + MARGIN))
    return found


class _Drive(NamedTuple):
    """A drive to a place, and what became of it."""

    asked: tuple[object, ...]
    side: float
    """On which it passes."""
    swing: float
    command: Twist
    is_bent: bool


class Detour:
    """Bends the path of one robot; it keeps the side on which it passes until nothing stands in the way."""

    def __init__(self) -> None:
        self._side = 0.0
        """1 while it passes on the left, -1 on the right, 0 with a free path."""
        self.swing = 0.0
        """Metres that the path was bent to the side at most, in the last step."""
        self._drive: _Drive | None = None
        """The newest one: a robot that waits asks for the same again."""

    def drive(
        self, view: View, own: Pose2, to: Pose2, standing: Sequence[Standing], speed: float, limits: Limits
    ) -> tuple[Twist, bool]:
        """The velocity from `own` straight to a place, both in map, round what stands there; and whether that bends it.

        `speed` is in m/s.
        """
        asked, last = (own, to.x, to.y, standing, speed, limits), self._drive
        # The scan is looked at only to choose a side, and that is kept.
        if last is None or last.side != self._side or last.asked != asked:
            way = Polyline((own[:2], to[:2]))
            bent = self.bend(view, way, 0.0, standing, LOOK_AHEAD)
            command = pursue(own, bent or way, 0.0, speed, limits)
            last = self._drive = _Drive(asked, self._side, self.swing, command, bent is not None)
        self.swing = last.swing
        # A new one each time, which the caller may change.
        return Twist(Vector3(last.command.linear.x), Vector3(z=last.command.angular.z)), last.is_bent

    def bend(
        self, view: View, path: Polyline, place: float, standing: Sequence[Standing], length: float = math.inf
    ) -> Polyline | None:
        """The piece of the path around `place`, in map, bent around what stands there; None if nothing does.

        It may end after `length` metres.
        """
        self.swing = 0.0
        if not standing:
            return None
        begin, end, here = place - REACH, place + AHEAD, path.at(place)
        # Mostly all stand so far away that no point of the path between the two can be near them.
        near = [robot for robot in standing if _distance(here, robot) < robot.distance + AHEAD + _ROUNDING]
        met = [(path.project(robot.x, robot.y, begin, end), robot) for robot in near]
        met = [(at, robot) for at, robot in met if _distance(path.at(at), robot) < robot.distance]
        if not met:
            self._side = 0.0
            return None
        self._side = self._side or _choose_side(view, path, *min(met))
        swings = [_Swing(at, _offset(path.at(at), robot, self._side)) for at, robot in met]
        self.swing = max(abs(swing.offset) for swing in swings)
        begin, end = max(begin, path.start), min(end + REACH, path.end)
        count = math.ceil((end - begin) / _STEP)
        bent = Polyline()
        for i in range(count + 1):
            at = begin + (end - begin) * i / max(count, 1)
            x, y, yaw = path.at(at)
            off = self._side * max(abs(swing.at(at)) for swing in swings)
            bent.append(x - off * math.sin(yaw), y + off * math.cos(yaw))
            if bent.end > length:
                break
        return bent


def _offset(at: Pose2, robot: Standing, side: float) -> float:
    """Metres to the left by which the path at `at` has to be bent to pass the robot on this side."""
    across = math.cos(at.yaw) * (robot.y - at.y) - math.sin(at.yaw) * (robot.x - at.x)
    return side * max(0.0, robot.distance + side * across)


def _choose_side(view: View, path: Polyline, place: float, robot: Standing) -> float:
    """1 = left, -1 = right: the shorter way if there is room for it, else where there is more room."""
    at = path.at(place)
    shorter = 1.0 if _offset(at, robot, 1.0) <= -_offset(at, robot, -1.0) else -1.0
    own = view.map_from_base()
    if own is None:
        return shorter
    room = {
        side: _room_at(view, own[0].inverse(), at.compose(Pose2(0.0, _offset(at, robot, side), 0.0)))
        for side in (shorter, -shorter)
    }
    enough = view.base.half_width + ROOM
    return shorter if room[shorter] >= min(enough, room[-shorter]) else -shorter


def _room_at(view: View, base_from_map: Pose2, at: Pose2) -> float:
    """Metres from the place `at` in map to the nearest hit of the laser that is not of another robot."""
    beams = beams_of(view.scan) if view.scan is not None else None
    if beams is None:
        return math.inf
    x, y = beams.find_hits(math.inf)
    free = np.ones(x.size, np.bool_)
    for mate in view.teammates:
        free &= (x - mate.pose.x) ** 2 + (y - mate.pose.y) ** 2 > BODY * BODY
    to = base_from_map.compose(at)
    return float(np.hypot(x - to.x, y - to.y).min(where=free, initial=math.inf))


def _distance(at: Pose2, robot: Standing) -> float:
    return math.hypot(at.x - robot.x, at.y - robot.y)
