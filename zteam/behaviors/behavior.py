"""What a behaviour is."""

from typing import Any, ClassVar

import msgspec

from zteam.behaviors.view import View
from zteam.messages import Twist


class Behavior:
    """Observations in, a velocity out: no bus, no sleeping, no clock but the view's, nothing random but the view's.

    A subclass writes `step` and names its parameters' type in `Params`, a msgspec.Struct that forbids unknown fields.
    The safety layer (`decide`) lies under every behaviour and stops it on old data and in front of obstacles.
    """

    Params: ClassVar[type[msgspec.Struct]]
    params: Any
    """Its parameters, a `Params`."""
    uses_tf: ClassVar[bool] = False
    """Whether it looks anything up; if so, it is stopped while the robot's own pose is unknown or old."""
    uses_odom: ClassVar[bool] = True
    """Whether it looks at `view.odom`; without it the robot listens to its odometry only until it is ready."""
    leader: int | None = None
    """The robot it follows."""
    reason: str = ""
    """Why it stands still, for the robot's status; empty while it does not."""

    def __init__(self, params: Any) -> None:
        self.params = params

    def step(self, view: View) -> Twist:
        """The velocity from now on, in the base frame: m/s and rad/s."""
        raise NotImplementedError

    def missing(self, view: View) -> list[str]:
        """What the behaviour itself still needs before the robot may call itself ready."""
        return []
