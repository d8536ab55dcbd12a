"""Which page drives which robot, and what it commands. Pure: the caller passes the host's time.

A lease is for one robot and one page. While it holds, the robot is commanded: with what the page says, and with zero
velocity when the page has said nothing for DEAD_MAN.
"""

import asyncio
import contextlib
import logging
from collections.abc import Iterator
from functools import partial
from typing import NamedTuple

import msgspec

from zteam.bus import Bus
from zteam.clock import monotonic
from zteam.errors import ZteamError
from zteam.messages import Twist, Vector3
from zteam.runtime.shutdown import Stop
from zteam.runtime.wheels import Wheels

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


log = logging.getLogger("zteam")

PERIOD = 0.05
"""Host seconds between two commands to a leased robot."""


class Driving:
    """All calls are made on the thread of the pages."""

    def __init__(self, bus: Bus) -> None:
        self._bus = bus
        self._call = asyncio.get_running_loop().call_soon_threadsafe
        self.leases = Leases()
        self._wheels: dict[int, Wheels] = {}
        self._timer: asyncio.TimerHandle | None = None

    async def take(self, robot_id: int, viewer: int) -> str:
        """Give a viewer the lease of a robot; why not, if that cannot be."""
        refusal = self.leases.take(robot_id, viewer)
        if refusal or robot_id in self._wheels:
            return refusal
        try:
            wheels = await asyncio.to_thread(self._open, robot_id)
        except ZteamError as error:
            self.leases.release(robot_id, viewer)
            return str(error)
        if self.leases.holder(robot_id) != viewer:
            # The page has gone meanwhile.
            await asyncio.to_thread(wheels.close)
            return "the lease was given back"
        self._wheels[robot_id] = wheels
        self._repeat()
        return ""

    def _open(self, robot_id: int) -> Wheels:
        stop = Stop()
        # An older holder of the robot's name has come, as after a broken network: this ends the lease alone.
        stop.on_request(partial(self._tell_lost, robot_id))
        wheels = Wheels(self._bus, robot_id, stop)
        try:
            wheels.take()
        except BaseException:
            wheels.close()
            raise
        return wheels

    def _tell_lost(self, robot_id: int) -> None:
        with contextlib.suppress(RuntimeError):
            self._call(self._lose, robot_id)

    def _lose(self, robot_id: int) -> None:
        holder, wheels = self.leases.holder(robot_id), self._wheels.pop(robot_id, None)
        if holder is not None:
            self.leases.release(robot_id, holder)
        if wheels is not None:
            wheels.close()

    async def release(self, robot_id: int, viewer: int) -> str:
        """Stop a robot and take its lease back; why not, if this viewer does not have it."""
        refusal = self.leases.release(robot_id, viewer)
        if not refusal:
            await self._close(robot_id)
        return refusal

    async def release_all(self, viewer: int) -> None:
        """A page has gone: stop its robots."""
        for robot_id in self.leases.of(viewer):
            await self.release(robot_id, viewer)

    async def _close(self, robot_id: int) -> None:
        wheels = self._wheels.pop(robot_id, None)
        if wheels is not None:
            with contextlib.suppress(ZteamError):
                wheels.drive(twist(STOP))
            await asyncio.to_thread(wheels.close)

    def drive(self, robot_id: int, viewer: int, velocity: Velocity) -> bool:
        """A page commands its robot; False if it does not have the lease."""
        now = monotonic()
        if not self.leases.drive(robot_id, viewer, velocity, now):
            return False
        if robot_id in self._wheels:
            self._wheels[robot_id].drive(twist(velocity))
        return True

    def _repeat(self) -> None:
        """Send every leased robot its command, until there is no lease."""
        if self._timer is not None:
            self._timer.cancel()
        self._timer = None
        if self._wheels:
            for robot_id, velocity in self.leases.commands(monotonic()):
                if robot_id in self._wheels:
                    self._wheels[robot_id].drive(twist(velocity))
            self._timer = asyncio.get_running_loop().call_later(PERIOD, self._repeat)

    def stop(self) -> None:
        """The process ends: stop all robots."""
        for wheels in self._wheels.values():
            with contextlib.suppress(ZteamError):
                wheels.drive(twist(STOP))
            wheels.close()
        self._wheels.clear()


def twist(velocity: Velocity) -> Twist:
    """The message of a velocity."""
    return Twist(Vector3(velocity.linear, velocity.left), Vector3(z=velocity.angular))
