"""The leader of the formations that are measured."""

import math

from msgspec import Struct

from zteam.behaviors import Behavior, View
from zteam.messages import Twist, Vector3


class SlalomParams(Struct, frozen=True, forbid_unknown_fields=True):
    """Parameters of the slalom."""

    speed: float = 0.4
    """m/s."""
    turn: float = 0.2
    """rad/s, at most."""
    frequency: float = 0.5
    """rad/s."""


class Slalom(Behavior):
    """The same speed for ever, with a turn rate that is a sine of time since the first step."""

    Params = SlalomParams
    params: SlalomParams

    def __init__(self, params: SlalomParams) -> None:
        super().__init__(params)
        self._begun = 0

    def step(self, view: View) -> Twist:
        """On round the next bend."""
        self._begun = self._begun or view.now
        seconds = (view.now - self._begun) / 1e9
        turn = self.params.turn * math.sin(self.params.frequency * seconds)
        return Twist(Vector3(self.params.speed), Vector3(z=turn))
