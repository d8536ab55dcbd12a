"""What a behaviour is."""

from collections.abc import Mapping
from numbers import Real
from typing import Any, ClassVar

import msgspec

from zteam.behaviors.view import View
from zteam.errors import BehaviorError
from zteam.messages import Message, Twist, Vector3


class NoParams(msgspec.Struct, forbid_unknown_fields=True):
    """The parameters of a behaviour that has none."""


def checked_command(command: Any, what: str) -> Twist:
    """`command`, returned by `what`. Raises BehaviorError if it is no velocity."""
    if isinstance(command, Twist):
        if isinstance(command.linear, Vector3) and isinstance(command.angular, Vector3):
            for speed in (command.linear.x, command.angular.z):
                if not isinstance(speed, (float, Real)):
                    raise BehaviorError(f"{what} returned the speed {speed!r}; give numbers, m/s and rad/s")
            return command
        raise BehaviorError(f"{what} returned {command!r}; return a Twist(Vector3(forward), Vector3(z=turn))")
    shown = "None" if command is None else f"a {type(command).__name__}"
    raise BehaviorError(f"{what} returned {shown}; return a Twist")


class Behavior:
    """Observations in, a velocity out: no bus, no sleeping, no clock but the view's, nothing random but the view's.

    A subclass writes `step`. If it takes parameters, it names their type in `Params`, a msgspec.Struct that forbids
    unknown fields. `zteam param set` replaces `params` between two steps; nothing else of the object changes.
    The safety layer (`decide`) lies under every behaviour and stops it on old data and in front of obstacles.
    """

    Params: ClassVar[type[msgspec.Struct]] = NoParams
    params: Any
    """Its parameters, a `Params`."""
    uses_tf: bool = False
    """Whether it drives by what it looks up; if so, it is stopped while the robot's own pose is unknown or old."""
    inputs: ClassVar[Mapping[str, tuple[str, type[Message]]]] = {}
    """What it looks at in `view.inputs` besides: by name, a topic of the own robot and its type, such as
    `{"goal": ("goal_pose", PoseStamped)}`; `robot_$*/status` is that topic of every robot."""
    leader: int | None = None
    """The robot that it was started to follow."""
    follows: int | None = None
    """The robot that it follows now: where a line is led from its other end, the one behind it."""
    gap: float = 0.0
    """Metres that it keeps to the robot that it follows."""
    turns: int = -1
    """How often its line has been led from the other end; -1 where it cannot be. Each robot takes the highest."""
    reason: str = ""
    """Why it stands still, for the robot's status; empty while it does not."""

    def __init__(self, params: Any) -> None:
        self.params = params

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        # What the class above it says of its own step need not be true of another one.
        if "step" in vars(cls) and "why_it_rests" not in vars(cls):
            cls.why_it_rests = Behavior.why_it_rests  # type: ignore[method-assign]

    def step(self, view: View) -> Twist:
        """The velocity from now on, in the base frame: m/s and rad/s."""
        raise BehaviorError(f"{type(self).__name__} has no step(view)")

    def on_params(self) -> None:
        """Do what a change of `params` needs; called before the next step. A `step` that reads them needs nothing."""

    def why_it_rests(self) -> str:
        """Why the velocity of its last step is zero without a `reason`, for the robot's status; empty = no word."""
        return ""

    def missing(self, view: View) -> list[str]:
        """What the behaviour itself still needs before the robot may call itself ready."""
        return []
