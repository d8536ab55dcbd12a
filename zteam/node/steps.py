"""When a node's steps are due."""

from collections.abc import Callable
from typing import NamedTuple, Protocol

from zteam.messages import Tick, Twist
from zteam.node.process_node import ProcessNode

Step = Callable[[int], Twist | None]
"""`step(now)`: a robot's own process (`robot_N`) may return its command, which goes to the wheels."""


class Due(NamedTuple):
    """A step that is due."""

    now: int
    """Its time in ns."""
    epoch: int = 0
    """The GO that holds, 0 = none."""
    tick: Tick | None = None
    """That of lock-step; None in real time."""
    is_first: bool = False
    """Whether it is the process's first tick."""


Act = Callable[[Due], Twist | None]
"""A step; the command of its robot."""


class StepTimer(Protocol):
    """When steps are due in real time. In lock-step the ticks say so (`Participant`)."""

    def wait(self, limit: float) -> None:
        """Wait until a step is due, or for at most `limit` host seconds."""

    def take(self) -> int | None:
        """The time (ns) of the step that is due; None if none is (under `node.changed`)."""


class NoSteps:
    """The timer of a process that takes part in lock-step and takes no steps in real time."""

    def __init__(self, node: ProcessNode) -> None:
        self._node = node

    def wait(self, limit: float) -> None:
        self._node.wait(lambda: False, limit)

    def take(self) -> int | None:
        return None
