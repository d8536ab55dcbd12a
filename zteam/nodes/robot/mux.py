"""The velocity mux, as ROS's twist_mux: which source of velocities drives the robot. Pure: it is told the time.

The first source of SOURCES that has been heard within its time-out drives; without one, the behaviour does.
"""

from collections.abc import Callable
from operator import attrgetter
from typing import Any, NamedTuple

from zteam import names
from zteam.clock import to_ns
from zteam.messages import Message, RobotDriver, Twist, TwistStamped
from zteam.nodes.robot.newest import Newest


class Source(NamedTuple):
    """One input of the mux."""

    driver: str
    """One of RobotDriver."""
    topic: str
    """Below `robot_N/`."""
    type: type[Message]
    velocity: Callable[[Any], Twist]
    """The velocity in a message."""
    timeout: int
    """Nanoseconds of the process's clock without a message after which it no longer drives."""


SOURCES = (
    Source(RobotDriver.TELEOP, names.CMD_VEL_TELEOP, Twist, lambda message: message, to_ns(0.5)),
    Source(RobotDriver.NAVIGATION, names.CMD_VEL_NAV, TwistStamped, attrgetter("twist"), to_ns(0.5)),
)
"""By priority, the highest first."""


class Choice(NamedTuple):
    """What drives instead of the behaviour."""

    driver: str
    velocity: Twist


class Mux:
    """The newest velocity of each source. The caller holds a lock."""

    def __init__(self, sources: tuple[Source, ...] = SOURCES) -> None:
        self.slots = [(source, Newest()) for source in sources]
        """Each source, and its newest velocity; the bus refuses those with numbers that are not finite."""

    def choose(self, now: int) -> Choice | None:
        """What drives at time `now` (ns) instead of the behaviour; None if nothing does."""
        for source, newest in self.slots:
            newest.settle(now)
            if newest.message is not None and abs(now - newest.stamp) <= source.timeout:
                return Choice(source.driver, source.velocity(newest.message))
        return None

    def forget(self) -> None:
        """Time jumped back."""
        for _, newest in self.slots:
            newest.forget()
