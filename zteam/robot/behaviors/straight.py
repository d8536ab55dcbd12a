"""Behaviours that need no memory: stand, drive straight on, stop in front of obstacles."""

import math
from typing import Annotated

from msgspec import Meta, Struct

from zteam.messages import Twist, Vector3
from zteam.robot.behaviors.behavior import Behavior
from zteam.robot.view import View, look_ahead


class Idle(Behavior):
    """Zero velocity for ever: for a robot that teleop or navigation drives."""

    def step(self, view: View) -> Twist:
        return Twist()

    def why_it_rests(self) -> str:
        return "idle: only teleop or navigation drives it"


class ForwardParams(Struct, frozen=True, forbid_unknown_fields=True):
    """Parameters of `forward`."""

    speed: Annotated[float, Meta(ge=-1.0, le=1.0, description="m/s; below 0 backwards, where no laser looks")] = 0.2


class Forward(Behavior):
    """The same speed for ever; only the safety layer stops it."""

    Params = ForwardParams
    params: ForwardParams

    def step(self, view: View) -> Twist:
        return Twist(linear=Vector3(x=self.params.speed))

    def why_it_rests(self) -> str:
        return super().why_it_rests() or "its base does not drive backwards"


class AvoidParams(Struct, frozen=True, forbid_unknown_fields=True):
    """Parameters of `avoid`."""

    speed: Annotated[float, Meta(ge=0.0, le=1.0, description="m/s")] = 0.2
    stop_distance: Annotated[
        float, Meta(ge=0.0, le=100.0, description="m to the laser; it stands while something is nearer")
    ] = 0.5
    half_angle: Annotated[float, Meta(ge=0.0, le=math.pi, description="rad; it looks this far to either side")] = (
        math.radians(60.0)
    )
    max_invalid: Annotated[
        float, Meta(ge=0.0, le=1.0, description="it stands while a larger share of beams says nothing")
    ] = 0.25


class Avoid(Behavior):
    """Forward while the cone ahead is known to be free; goes on when it is free again."""

    Params = AvoidParams
    params: AvoidParams

    def step(self, view: View) -> Twist:
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
