"""Drive about at random (the lectures' random walk, mended)."""

import math
from typing import Annotated

from msgspec import Meta, Struct

from zteam.behaviors.behavior import Behavior
from zteam.behaviors.scans import Cone, look_ahead, look_along
from zteam.behaviors.view import View
from zteam.messages import LaserScan, Twist, Vector3

HALF_ANGLE = math.radians(45.0)
"""It looks this far to either side."""
REACTION_TIME = 0.2
"""Seconds from something coming into reach until the wheels obey: one scan and one command at 10 Hz."""
BRAKING = 1.0
"""m/s²: a base may not stop at once."""
MAX_TURN = math.radians(120.0)
"""A turn goes at least as far as an angle drawn from 0 to this, and on until the way is free."""
AWAY = 0.8
"""How often it turns away from what is nearest; always would be a circle in many a room."""
SHORT_DRIVE = 1.0
"""Metres: where it has to turn again after less than this, the place is narrow."""
SIDE_MARGIN = 0.015
"""Metres on either side of the circle that the base's corners describe when it turns: what it needs to squeeze
through."""


class WanderParams(Struct, frozen=True, forbid_unknown_fields=True):
    """Parameters of `wander`."""

    speed: Annotated[float, Meta(ge=0.0, le=1.0, description="m/s")] = 0.4
    turn_rate: Annotated[float, Meta(ge=0.1, le=math.pi, description="rad/s")] = 1.0
    stop_distance: Annotated[float, Meta(ge=0.0, le=100.0, description="m; left ahead of the laser when it stands")] = (
        0.5
    )
    max_invalid: Annotated[
        float, Meta(ge=0.0, le=1.0, description="it turns while a larger share of beams says nothing")
    ] = 0.25


class Wander(Behavior):
    """Forward while the way is free; else turn by a random angle, mostly away from what is nearest, till it is free.

    It keeps the side until it drives again, so it does not swing in a corner. Where it gets on badly (a short drive,
    or a full turn without a free cone) it squeezes: the next heading will do that leaves room for the robot alone.
    """

    Params = WanderParams
    params: WanderParams
    uses_odom = False

    def __init__(self, params: WanderParams) -> None:
        super().__init__(params)
        self._side = 0.0
        """1 while turning left, -1 while turning right, 0 while driving."""
        self._turned = 0.0
        self._wanted = 0.0
        """Radians turned since it stopped, and how many there are to be at least."""
        self._driven = SHORT_DRIVE
        """Metres since the last turn."""
        self._squeezing = False

    def step(self, view: View) -> Twist:
        """Straight on or a turn on the spot; zero without a scan."""
        if view.scan is None:
            self.reason = "no scan yet"
            return Twist()
        self.reason = ""
        if self._side:
            self._turned += self.params.turn_rate * view.dt
        else:
            self._driven += self.params.speed * view.dt
        cone = look_ahead(view.scan, HALF_ANGLE)
        if cone and self._may_drive(cone, view.scan, view.base.radius + SIDE_MARGIN):
            self._driven = 0.0 if self._side else self._driven
            self._side = 0.0
            return Twist(linear=Vector3(x=self.params.speed))
        if not self._side:
            self._start_turn(view, cone)
        return Twist(angular=Vector3(z=self._side * self.params.turn_rate))

    def _start_turn(self, view: View, cone: Cone | None) -> None:
        away = -math.copysign(1.0, cone.bearing) if cone else 1.0
        self._side = away if view.random(0) < AWAY else -away
        self._squeezing = self._driven < SHORT_DRIVE
        # In a narrow place the next free heading is the way out, and a large turn the way back in.
        self._wanted = 0.0 if self._squeezing else MAX_TURN * view.random(1)
        self._turned = 0.0

    def _may_drive(self, cone: Cone, scan: LaserScan, half_width: float) -> bool:
        speed = self.params.speed
        reach = self.params.stop_distance + REACTION_TIME * speed + 0.5 * speed * speed / BRAKING
        if cone.invalid > self.params.max_invalid:
            return False
        if self._side and self._turned >= math.tau:
            self._squeezing = True
        clear = look_along(scan, half_width) >= reach and (self._squeezing or cone.nearest >= reach)
        return clear and (not self._side or self._turned >= self._wanted)
