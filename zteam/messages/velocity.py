"""What a step returns: a velocity of a robot's base."""

from numbers import Real
from typing import Any

from zteam.errors import BehaviorError
from zteam.messages.geometry_msgs import Twist, Vector3


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
