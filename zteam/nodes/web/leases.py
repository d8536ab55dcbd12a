"""Which page drives which robot, and what it commands. Pure: the caller passes the host's time.

A lease is for one robot and one page. While it holds, the robot is commanded: with what the page says, and with zero
velocity when the page has said nothing for DEAD_MAN.
"""

from collections.abc import Iterator
from typing import NamedTuple

import msgspec

DEAD_MAN = 0.5
"""Host seconds for which what a page says counts."""


class Velocity(NamedTuple):
    """m/s forward, rad/s counter-clockwise, m/s to the left."""

    linear: float = 0.0
    angular: float = 0.0
    left: float = 0.0


STOP = Velocity()


class Lease(msgspec.Struct):
    """One robot's."""

    viewer: int
    velocity: Velocity = STOP
    until: float = float("-inf")
    """Host time until which that velocity counts."""


class Leases:
    """All robots' leases."""

    def __init__(self) -> None:
        self._leases: dict[int, Lease] = {}

    def holder(self, robot_id: int) -> int | None:
        """The viewer that drives a robot; None if none does."""
        lease = self._leases.get(robot_id)
        return None if lease is None else lease.viewer

    def of(self, viewer: int) -> list[int]:
        """The robots that a viewer drives."""
        return [robot_id for robot_id, lease in self._leases.items() if lease.viewer == viewer]

    def take(self, robot_id: int, viewer: int) -> str:
        """Give a viewer the lease; why not, if another one has it."""
        holder = self.holder(robot_id)
        if holder is not None and holder != viewer:
            return f"viewer {holder} drives this robot"
        self._leases.setdefault(robot_id, Lease(viewer))
        return ""

    def release(self, robot_id: int, viewer: int) -> str:
        """Take the lease back; why not, if this viewer does not have it."""
        if self.holder(robot_id) != viewer:
            return "this page does not drive this robot"
        del self._leases[robot_id]
        return ""

    def drive(self, robot_id: int, viewer: int, velocity: Velocity, now: float) -> bool:
        """A viewer commands its robot; False if it does not have the lease."""
        lease = self._leases.get(robot_id)
        if lease is None or lease.viewer != viewer:
            return False
        lease.velocity, lease.until = velocity, now + DEAD_MAN
        return True

    def commands(self, now: float) -> Iterator[tuple[int, Velocity]]:
        """What each leased robot is commanded at host time `now`."""
        for robot_id, lease in self._leases.items():
            yield robot_id, lease.velocity if now < lease.until else STOP
