"""How a robot leads a line: it drives about at random, looks before it turns, and hands over where it is stuck."""

import math

from zteam.clock import to_ns
from zteam.geometry import Pose2, normalize_angle
from zteam.messages import LaserScan, Twist, Vector3
from zteam.robot.behaviors.evasion import Escape, Pause
from zteam.robot.behaviors.line import Place, keep_together
from zteam.robot.scans import is_seen, look_along
from zteam.robot.view import View

FREE = 1.0
"""Metres ahead that have to be free for it to drive straight on."""
ROOMY, MOST_ROOM = 1.3, 5.0
"""Metres that have to be free along a new heading; more than the second counts no more."""
HALF_WIDTH = 0.06
"""Metres besides the base's radius that have to be free on either side."""
MATE = 0.62
"""Metres on either side within which another robot is in the way."""
HEADINGS = tuple(math.radians(10.0 * step) for step in range(-11, 12))
"""Of which it draws one: never back past its own line."""
CHANCE, EVERY = 0.1, 0.4
"""How often it draws another heading without need: with this chance after each so many metres."""
ON_THE_SPOT = 0.8
"""Radians: it turns on the spot to a heading that is further off, or where less than NARROW metres are free."""
NARROW = 0.7
ALIGNED = 0.1
"""Radians to its heading from which on it drives straight."""
TURN_GAIN = 2.0
"""1/s."""
PATIENCE, PROGRESS = to_ns(6.0), 0.4
"""It hands over if it has not come so many metres in so many nanoseconds."""
FIRST = to_ns(3.0)
"""Nanoseconds in which a new head does not hand over for lack of a heading: its line still moves."""


class Head:
    """The law of the robot that leads."""

    def __init__(self) -> None:
        self._since: int | None = None
        """Nanoseconds: when it began to lead; None while it does not."""
        self._heading: float | None = None
        """In map (rad), while it turns."""
        self._anchor = Pose2(0.0, 0.0, 0.0), 0
        """Where it got on last, and when."""
        self._drawn_at = Pose2(0.0, 0.0, 0.0)
        self._escape, self._pause = Escape(), Pause()

    def rest(self) -> None:
        """It does not lead."""
        self._since = None

    def step(self, view: View, own: Pose2, place: Place, speed: float, turn_rate: float) -> tuple[Twist | None, str]:
        """The velocity, and why it is zero; None where it is to hand over."""
        scan = view.scan
        if scan is None:
            return Twist(), "no scan yet"
        if self._pause.is_over(view.now) or self._since is None:
            self._since, self._anchor, self._drawn_at, self._heading = view.now, (own, view.now), own, None
        if math.dist(own[:2], self._anchor[0][:2]) > PROGRESS:
            self._anchor = own, view.now
        elif view.now - self._anchor[1] > PATIENCE:
            return None, ""
        if self._heading is not None and abs(normalize_angle(self._heading - own.yaw)) < ALIGNED:
            self._heading = None
        ahead = self._room(view, scan, 0.0)
        if self._heading is None and self._wants_another(view, own, ahead):
            self._drawn_at = own
            turn = self._draw(view, scan)
            if turn is None:
                if ahead < FREE and view.now - self._since > FIRST:
                    return None, ""
                turn = math.pi if ahead < FREE else 0.0
            self._heading = normalize_angle(own.yaw + turn)
        share, reason = keep_together(view, place)
        error = 0.0 if self._heading is None else normalize_angle(self._heading - own.yaw)
        turn = max(-turn_rate, min(turn_rate, TURN_GAIN * error))
        if abs(error) > ON_THE_SPOT or ahead < NARROW:
            return self._escape.free(view, Twist(angular=Vector3(z=turn))), ""
        return Twist(Vector3(speed * share), Vector3(z=turn * share)), "" if share else reason

    def _wants_another(self, view: View, own: Pose2, ahead: float) -> bool:
        if ahead < FREE:
            return True
        if math.dist(own[:2], self._drawn_at[:2]) < EVERY:
            return False
        self._drawn_at = own
        return view.random(0) < CHANCE

    def _draw(self, view: View, scan: LaserScan) -> float | None:
        """Of the headings with enough room one (rad), the likelier the more room and the less to the side."""
        best, most = None, 0.0
        for draw, heading in enumerate(HEADINGS, 1):
            room = self._room(view, scan, heading) if is_seen(scan, heading) else 0.0
            weight = min(room, MOST_ROOM) * view.random(draw) * (1.2 - abs(heading) / math.pi)
            if room > ROOMY and weight > most:
                best, most = heading, weight
        return best

    def _room(self, view: View, scan: LaserScan, heading: float) -> float:
        """Metres that are free of walls and robots towards a heading (rad)."""
        room = look_along(scan, view.base.radius + HALF_WIDTH, heading)
        for mate in view.teammates:
            along, across = mate.along(heading)
            if along > 0.0 and abs(across) < MATE:
                room = min(room, along)
        return room
