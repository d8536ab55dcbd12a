"""Robots driven from pages: leases, and the way to each leased robot's wheels."""

import asyncio
import contextlib
import logging
from functools import partial

from zteam.bus import Bus
from zteam.clock import monotonic
from zteam.errors import ZteamError
from zteam.messages import Twist, Vector3
from zteam.nodes.web.leases import STOP, Leases, Velocity
from zteam.runtime.shutdown import Stop
from zteam.runtime.wheels import Wheels

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
