"""How the robots of a line spread out when neither of its ends can advance: each one moves away from the others.

A line can fold up in a small room, and its own robots then enclose its ends. Every chain unfolds by motions
that bring no two of its parts nearer to each other (Connelly, Demaine and Rote: Straightening polygonal arcs, 2003).
"""

import math

from zteam.clock import to_ns
from zteam.messages import Twist, Vector3
from zteam.robot.behaviors.line import LineRole
from zteam.robot.behaviors.path import SpeedLimits
from zteam.robot.view import View, is_seen, look_along

LASTS = to_ns(8.0)
"""Nanoseconds for which the robots spread out."""
AGAIN = to_ns(15.0)
"""Nanoseconds: a head that hands over sooner could not advance. The time of spreading out is not counted."""
STEP, FREE = 0.3, 0.55
"""Metres to the places that a robot compares, and metres that have to be free of walls towards one."""
HEADINGS = tuple(math.radians(10.0 * step) for step in range(-17, 19))
END = 3.0
"""Of 1/d, by which a robot pushes away one that is d metres off: so much stronger is an end, which needs room."""
PULL = 20.0
"""1/m³: of the square of the metres that a neighbour in the line is further away than the gap."""
NEAR, CLOSE, WORTH = 0.6, 100.0, 0.01
"""Metres from base to base within which a place costs so much more (1/m²), so that both can turn; and by how much a
place has to be better than the robot's own (1/m)."""
SPEED, TURN_RATE, TURN_GAIN, ON_THE_SPOT = 0.25, 1.0, 2.0, 0.5
"""m/s, rad/s and 1/s of the way there; and the radians from which on the robot turns on the spot."""


class Spreading:
    """When the robots of a line spread out."""

    def __init__(self) -> None:
        self._turns, self._turned, self._until = 0, -AGAIN, -AGAIN
        """How often the line has turned, when it did so last, and until when its robots spread out (ns)."""

    def is_due(self, view: View, role: LineRole) -> bool:
        """Whether they do now: the line has turned twice within a short time."""
        if role.turns > self._turns:
            if view.now - max(self._turned, self._until) < AGAIN:
                self._until = view.now + LASTS
            self._turned = view.now
        self._turns = role.turns
        return role.may_turn and view.now < self._until


def spread(view: View, role: LineRole, limits: SpeedLimits) -> Twist:
    """The velocity towards the place nearby that is further from the others, and not too far from its neighbours."""
    if view.scan is None:
        return Twist()
    scan, ends = view.scan, {(role.before or (-1,))[-1], (role.after or (-1,))[-1]}
    neighbours = {*role.before[:1], *role.after[:1]}
    pull = PULL if role.before and role.after else END * PULL

    def cost(x: float, y: float) -> float:
        total = 0.0
        for mate in view.teammates:
            apart = math.hypot(mate.pose.x - x, mate.pose.y - y)
            total += (END if mate.robot_id in ends else 1.0) / max(apart, STEP) + CLOSE * max(0.0, NEAR - apart)
            if mate.robot_id in neighbours:
                total += pull * max(0.0, apart - role.gap) ** 2
        return total

    best, lowest = None, cost(0.0, 0.0) - WORTH
    for heading in HEADINGS:
        costs = cost(STEP * math.cos(heading), STEP * math.sin(heading))
        # What is not seen is seen when it has turned.
        if costs < lowest and not (is_seen(scan, heading) and look_along(scan, view.base.radius, heading) < FREE):
            best, lowest = heading, costs
    if best is None:
        return Twist()
    turn = limits.clamp_turn(max(-TURN_RATE, min(TURN_RATE, TURN_GAIN * best)))
    return Twist(Vector3(min(SPEED, limits.linear) if abs(best) < ON_THE_SPOT else 0.0), Vector3(z=turn))
