"""Drive straight on (the lectures' move_robot)."""

from typing import Annotated

from msgspec import Meta, Struct

from zteam.behaviors.behavior import Behavior
from zteam.behaviors.view import View
from zteam.messages import Twist, Vector3


class ForwardParams(Struct, frozen=True, forbid_unknown_fields=True):
    """Parameters of `forward`."""

    speed: Annotated[float, Meta(ge=-1.0, le=1.0, description="m/s; below 0 backwards, where no laser looks")] = 0.2


class Forward(Behavior):
    """The same speed for ever; only the safety layer stops it."""

    Params = ForwardParams
    params: ForwardParams

    def step(self, view: View) -> Twist:
        """Straight on."""
        return Twist(linear=Vector3(x=self.params.speed))

    def why_it_rests(self) -> str:
        """It is told to, or to drive backwards with a base that cannot."""
        return "its parameter speed is 0" if not self.params.speed else "its base does not drive backwards"
