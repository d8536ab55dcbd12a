"""How a robot gets free in a narrow place: it looks for a way of turns on the spot and straight drives, and tries it.

The laser does not see all that stands around a robot, and the safety layer knows more than a scan shows. So odometry
tells whether a turn or a drive works. One that does not is not tried there again for a while, and the next best way is.
"""

import math
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from zteam.clock import to_ns
from zteam.geometry import Point2, Pose2, normalize_angle
from zteam.kernels import escape as kernels
from zteam.messages import Point, Twist, Vector3
from zteam.messages.planar import pose2_of
from zteam.robot.safety.motion import outline_of
from zteam.robot.view import View, beams_of

CELL = 0.05
"""Metres: side of a cell of the search. The robot stands on the middle one, and its x axis is the search's."""
_HALF = ((2, 0), (2, 1), (1, 1), (1, 2), (0, 2), (-1, 2), (-1, 1), (-2, 1))
STEPS = (*_HALF, *((-x, -y) for x, y in _HALF))
"""Cells of a step forward for each heading, counter-clockwise."""
_HEADINGS = np.array([(x, y, yaw := math.atan2(y, x), math.cos(yaw), math.sin(yaw)) for x, y in STEPS])
AWAY, LEAST_AWAY = 1.0, 0.6
"""Metres that it leads away without a way, if there is room, and that it does at least."""
BESIDE = 0.9
"""Metres from teammates, which wait for the robot or come after it, that it leads to then."""


class Move(NamedTuple):
    """A part of a way."""

    kind: int
    """1 is a drive forward, -1 back, 2 a turn to the left, -2 to the right."""
    end: Pose2


def _from_frame(pose: Pose2, points: NDArray[np.floating[Any]]) -> NDArray[np.float64]:
    """Points (2, n) of the frame at `pose`, in the frame that this is in."""
    (x, y, yaw), (xs, ys) = pose, points
    cos, sin = math.cos(yaw), math.sin(yaw)
    return np.array((x + cos * xs - sin * ys, y + sin * xs + cos * ys))


def find_moves(
    view: View, hits: NDArray[np.float64], way: Sequence[Point2], failed: Iterable[tuple[int, Pose2]]
) -> list[Move]:
    """The moves that bring the robot to the end of `way`, or nearer to that; without a way, away from here and from the
    teammates. Empty if none do.

    `hits` (2, n) are on what stands around besides the teammates. `failed`: moves that did not work, and where: none
    like them is tried near there. All is in the robot's base frame now.
    """
    outline = outline_of(view.base.footprint)
    # Teammates more metres away are out of reach.
    near_mates = [mate for mate in view.teammates if math.hypot(*mate.pose[:2]) < 3.2 + mate.base.radius]
    borders = [_from_frame(mate.pose, outline_of(mate.base.footprint).border) for mate in near_mates]
    found = kernels.find_moves(
        outline.rows, outline.radius, np.hstack([hits, *borders]).T, hits.shape[1], way,
        [mate.pose[:2] for mate in view.teammates], [(kind, *pose) for kind, pose in failed],
        _HEADINGS, CELL, (AWAY, LEAST_AWAY, BESIDE),
    )  # fmt: skip
    return [Move(int(kind), Pose2(x, y, yaw)) for kind, x, y, yaw in found.tolist()]


TURNS_WITHIN = to_ns(1.0)
"""Nanoseconds without turning after which it looks for a way."""
HAS_TURNED = 0.05
"""Radians; a smaller change of heading is no turn."""
FREED, ROOM = 1.0, 0.1
"""Metres from there after which it is free; and to a teammate that may block it."""
COMES, COMES_WITHIN = 0.2, to_ns(4.0)
"""Metres that it has to come away in so many nanoseconds where it wants to get to a place."""
AGAIN = to_ns(0.5)
"""Nanoseconds without being asked after which what it wanted before does not count."""
SPEED, BACK_SPEED, TURN_RATE = 0.3, 0.2, 1.5
"""m/s and rad/s of a move."""
GAIN, LEAST = 4.0, 0.1
"""1/s: speed by what is left of a move; and m/s and rad/s at least."""
DONE = 0.05
"""Metres or radians to the end of a move at which it is done."""
WORKS, WORKS_WITHIN = 0.06, to_ns(0.8)
"""Metres or radians that it has to come on in so many nanoseconds, or the move does not work."""
KEPT = to_ns(20.0)
"""Nanoseconds for which a move is not tried again that did not work: what stood there may drive on."""
LOOKS_ROUND, LOOKS_EACH = to_ns(0.8), to_ns(0.5)
"""Nanoseconds without getting on after which it remembers what it sees, and between two such looks."""
SEEN, BODY = 2.0, 0.1
"""Metres from the laser up to which it remembers hits, and metres beside a teammate that may be that one."""
KNOT, STANDS, LOOSENS = 0.5, to_ns(13.0), 0.1
"""A robot that has not come so many metres in so many nanoseconds may be what holds the others: with this chance in a
step it makes room for them, wherever there is some."""
RESTS = to_ns(1.0)
"""Nanoseconds from a search that found no way to the next one."""


def _is_mate_near(view: View) -> bool:
    """Whether a teammate may block a turn."""
    return any(math.hypot(*mate.pose[:2]) < view.base.radius + ROOM + mate.base.radius for mate in view.teammates)


class Escape:
    """Watches whether a robot gets on, and moves it where it does not."""

    def __init__(self) -> None:
        self._turned, self._came = (0.0, 0), ((math.inf, math.inf), 0)
        """The heading (rad) or place in odometry from which it has not got on, and since when (ns)."""
        self._stuck_at: Point2 | None = None
        """Where it got stuck, in odometry; None while it is free."""
        self._by_mate = False
        """Whether a teammate was near when it got stuck."""
        self._stood: tuple[Point2, int] = (math.inf, math.inf), 0
        """Where in odometry it got on last, and when (ns)."""
        self._asked = self._looks_at = 0
        """When it was asked last, and when it may look for a way again (ns)."""
        self._moves: list[Move] = []
        """What is left to do, in odometry."""
        self._left, self._since = math.inf, 0
        """What was left of the move when it got on last (m or rad), and when that was (ns)."""
        self._failed: list[tuple[int, int, Pose2]] = []
        """Which moves did not work: when (ns), of which kind, and where in odometry."""
        self._seen: list[tuple[int, NDArray[np.float64]]] = []
        """What it saw while it did not get on: when (ns), and (2, n) hits in odometry."""

    def rest(self) -> None:
        """That it has not got on until now does not count."""
        self._stuck_at, self._asked, self._stood = None, 0, ((math.inf, math.inf), 0)

    @property
    def is_moving(self) -> bool:
        """Whether it gets itself free."""
        return self._stuck_at is not None

    def free(self, view: View, command: Twist, way: Sequence[Point2] = ()) -> Twist:
        """The velocity instead of `command`, by which the robot drives along a way (m, base frame) to its end.

        Without a way it is left alone unless it is to turn on the spot and cannot.
        """
        own, now = None if view.odom is None else pose2_of(view.odom.pose.pose), view.now
        if own is None:
            return command
        is_new, self._asked = now - self._asked > AGAIN, now
        is_turn, is_drive = command.angular.z != 0.0, command.linear.x != 0.0
        if is_new or not is_turn or is_drive or abs(normalize_angle(own.yaw - self._turned[0])) > HAS_TURNED:
            self._turned = own.yaw, now
        if is_new or not way or not (is_turn or is_drive) or math.dist(own[:2], self._came[0]) > COMES:
            self._came = own[:2], now
        if not (is_turn or is_drive):
            self._stuck_at = None
        cannot_turn = now - self._turned[1] > TURNS_WITHIN
        if self._stuck_at is None and now - min(self._turned[1], self._came[1]) > LOOKS_ROUND:
            self._look_round(view, own)
        if self._stuck_at is None and now > self._looks_at and (cannot_turn or now - self._came[1] > COMES_WITHIN):
            self._stuck_at, self._moves, self._by_mate = own[:2], [], _is_mate_near(view)
            if cannot_turn:
                self._failed.append((now, 2 if command.angular.z > 0.0 else -2, own))
        if self._stuck_at is None:
            return command
        self._look_round(view, own)
        aside = math.copysign(0.5 * math.pi, command.angular.z)
        freed = self._move(view, own)
        is_free = (self._by_mate and not _is_mate_near(view)) or math.dist(own[:2], self._stuck_at) > FREED
        if freed is None and (not self._moves or way) and not is_free:
            self._find(view, own, way or [(math.cos(aside), math.sin(aside))])
            freed = self._move(view, own)
        if freed is None:
            # Whatever it does next, it has a while to get on.
            self._turned, self._came = (own.yaw, now), (own[:2], now)
            self._stuck_at, self._looks_at = None, now + RESTS
        return freed or command

    def leave(self, view: View) -> bool:
        """Whether there is a way away from here; `free` then takes it."""
        own = None if view.odom is None else pose2_of(view.odom.pose.pose)
        if own is None:
            return False
        self._asked = view.now
        self._look_round(view, own)
        self._find(view, own, ())
        # At its end nothing is left to do.
        self._stuck_at = (math.inf, math.inf) if self._moves else None
        return bool(self._moves)

    def makes_room(self, view: View, *, counts: bool) -> bool:
        """Whether the robot leaves a place where it has stood for long. A reason to stand stops its clock."""
        place = Point() if view.odom is None else view.odom.pose.pose.position
        at = place.x, place.y
        if math.dist(at, self._stood[0]) > KNOT:
            self._stood = at, view.now
        elif not counts:
            self._stood = self._stood[0], self._stood[1] + to_ns(view.dt)
        is_leaving, stands = self._stuck_at == (math.inf, math.inf), view.now - self._stood[1] > STANDS
        return is_leaving or (stands and view.random(0) < LOOSENS and self.leave(view))

    def _look_round(self, view: View, own: Pose2) -> None:
        """Remember what the laser sees now and then: it does not look behind. Teammates move, and are known."""
        beams = None if view.scan is None else beams_of(view.scan)
        if beams is None or (self._seen and view.now - self._seen[-1][0] < LOOKS_EACH):
            return
        hits = beams.find_hits(SEEN) + np.array(view.laser)[:, None]
        for mate in view.teammates:
            hits = hits[:, np.hypot(hits[0] - mate.pose.x, hits[1] - mate.pose.y) > mate.base.radius + BODY]
        # As complex numbers: numpy is slow to sort pairs.
        cells = np.unique(np.round(hits[0] / CELL) + 1j * np.round(hits[1] / CELL))
        hits = CELL * np.array((cells.real, cells.imag))
        self._seen = [each for each in self._seen if view.now - each[0] < KEPT]
        self._seen.append((view.now, _from_frame(own, hits)))

    def _find(self, view: View, own: Pose2, way: Sequence[Point2]) -> None:
        """Find moves along a way."""
        self._failed = [each for each in self._failed if view.now - each[0] < KEPT]
        to_base = own.inverse()
        hits = _from_frame(to_base, np.hstack([np.empty((2, 0)), *(seen for _, seen in self._seen)]))
        failed = [(kind, to_base.compose(at)) for _, kind, at in self._failed]
        found = find_moves(view, hits, way, failed)
        self._moves = [Move(kind, own.compose(end)) for kind, end in found]
        if not found:
            # A move that did not work may do so now: a robot that stood there has driven on.
            self._failed = []
        self._left, self._since = math.inf, view.now

    def _move(self, view: View, own: Pose2) -> Twist | None:
        """The velocity of its moves; None at their end, or where one does not work."""
        while self._moves:
            kind, end = self._moves[0]
            at = own.inverse().compose(end)
            if abs(kind) == 2:
                side = math.copysign(1.0, kind)
                left = (side * at.yaw + 0.5) % math.tau - 0.5
            else:
                left = kind * at.x
            if left < DONE:
                self._moves.pop(0)
                self._left, self._since = math.inf, view.now
                continue
            if left < self._left - WORKS:
                self._left, self._since = left, view.now
            elif view.now - self._since > WORKS_WITHIN:
                self._failed.append((view.now, kind, own))
                self._moves = []
                break
            rate = max(LEAST, GAIN * left)
            if abs(kind) == 2:
                return Twist(angular=Vector3(z=side * min(TURN_RATE, rate)))
            # It comes to a stop at the end, and on the way there back to the straight line.
            turn = max(-0.3, min(0.3, GAIN * at.yaw + kind * 4.0 * at.y * min(1.0, left)))
            return Twist(Vector3(min(SPEED, rate) if kind == 1 else -min(BACK_SPEED, rate)), Vector3(z=turn))
        return None
