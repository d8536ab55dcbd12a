"""Drive straight on and stop in front of obstacles (the lectures' stopper, mended)."""

import math
from typing import Annotated

import msgspec

from zteam.behaviors.behavior import Behavior
from zteam.behaviors.scans import look_ahead
from zteam.behaviors.view import View
from zteam.messages import Twist, Vector3


class AvoidParams(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Parameters of `avoid`."""

    speed: Annotated[float, msgspec.Meta(ge=0.0, le=1.0)] = 0.2
    """m/s."""
    stop_distance: Annotated[float, msgspec.Meta(ge=0.0, le=100.0)] = 0.5
    """It stands while something is nearer than this to the laser, metres."""
    half_angle: Annotated[float, msgspec.Meta(ge=0.0, le=math.pi)] = math.radians(60.0)
    """It looks this far to either side, radians."""
    max_invalid: Annotated[float, msgspec.Meta(ge=0.0, le=1.0)] = 0.25
    """It stands while a larger share of the beams says nothing."""


class Avoid(Behavior):
    """Forward while the cone ahead is known to be free; goes on when it is free again."""

    Params = AvoidParams
    params: AvoidParams
    uses_odom = False

    def step(self, view: View) -> Twist:
        """Straight on, or zero."""
        self.reason = self._obstruction(view)
        return Twist() if self.reason else Twist(linear=Vector3(x=self.params.speed))

    def _obstruction(self, view: View) -> str:
        if view.scan is None:
            return "no scan yet"
        cone = look_ahead(view.scan, self.params.half_angle)
        if cone is None:
            return "no beam of the scan looks ahead"
        if cone.invalid > self.params.max_invalid:
            return "too many beams say nothing"
        return "obstacle ahead" if cone.nearest < self.params.stop_distance else ""
