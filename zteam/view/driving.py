"""Which page drives which robot, and what it commands.

A lease is for one robot and one page. While it holds, the robot is commanded: with what the page says, and with zero
velocity when the page has said nothing for DEAD_MAN. It ends when another one drives the robot, or when the page has
said nothing for GONE: a page with a lease sends ten commands a second.
"""

import asyncio
import contextlib
from functools import partial

import msgspec

from zteam.bus import Bus
from zteam.clock import monotonic
from zteam.errors import ZteamError
from zteam.messages import Twist
from zteam.node.shutdown import Stop
from zteam.robot.wheels import Wheels

DEAD_MAN = 0.5
"""Host seconds for which what a page says counts."""
GONE = 2.0
"""Host seconds without a word after which a page has gone: the end of its socket may come much later."""
PERIOD = 0.05
"""Host seconds between two commands to a leased robot."""


class Lease(msgspec.Struct):
    """One robot's."""

    viewer: int
    wheels: Wheels | None = None
    """None until the way to them is found."""
    command: Twist = msgspec.field(default_factory=Twist)
    heard: float = msgspec.field(default_factory=monotonic)
    """Host time of the page's last word: the command counts for DEAD_MAN from then."""

    def is_silent(self, now: float) -> bool:
        return now - self.heard >= DEAD_MAN

    def send(self, now: float) -> None:
        if self.wheels is not None:
            self.wheels.drive(Twist() if self.is_silent(now) else self.command)


class Driving:
    """All calls are made on the thread of the pages."""

    def __init__(self, bus: Bus) -> None:
        self._bus = bus
        self._loop = asyncio.get_running_loop()
        self._leases: dict[int, Lease] = {}
        """By the robot's id."""
        self._timer: asyncio.TimerHandle | None = None

    def holder(self, robot_id: int) -> int | None:
        """The viewer that drives a robot; None if none does."""
        lease = self._leases.get(robot_id)
        return None if lease is None else lease.viewer

    async def take(self, robot_id: int, viewer: int) -> str:
        """Give a viewer the lease of a robot; why not, if that cannot be."""
        holder = self.holder(robot_id)
        if holder == viewer:
            return ""
        if holder is not None:
            if not self._leases[robot_id].is_silent(monotonic()):
                return f"viewer {holder} drives this robot"
            await self.release(robot_id, holder)
        lease = self._leases[robot_id] = Lease(viewer)
        try:
            wheels = await asyncio.to_thread(self._open, robot_id)
        except ZteamError as error:
            if self._leases.get(robot_id) is lease:
                del self._leases[robot_id]
            return str(error)
        if self._leases.get(robot_id) is not lease:
            # The page has gone meanwhile.
            await asyncio.to_thread(wheels.close)
            return "the lease was given back"
        lease.wheels, lease.heard = wheels, monotonic()
        wheels.press()
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
            self._loop.call_soon_threadsafe(self._lose, robot_id)

    def _lose(self, robot_id: int) -> None:
        lease = self._leases.pop(robot_id, None)
        if lease is not None and lease.wheels is not None:
            lease.wheels.close()

    async def release(self, robot_id: int, viewer: int) -> str:
        """Stop a robot and take its lease back; why not, if this viewer does not have it."""
        if self.holder(robot_id) != viewer:
            return "this page does not drive this robot"
        wheels = self._leases.pop(robot_id).wheels
        if wheels is not None:
            _halt(wheels)
            await asyncio.to_thread(wheels.close)
        return ""

    async def release_all(self, viewer: int) -> None:
        """A page has gone: stop its robots."""
        for robot_id in [robot_id for robot_id, lease in self._leases.items() if lease.viewer == viewer]:
            await self.release(robot_id, viewer)

    def drive(self, robot_id: int, viewer: int, command: Twist) -> bool:
        """A page commands a robot; whether it has the lease. Without it that changes nothing."""
        lease, now = self._leases.get(robot_id), monotonic()
        if lease is None or lease.viewer != viewer:
            return False
        if lease.wheels is not None and command != Twist() and (lease.is_silent(now) or lease.command == Twist()):
            lease.wheels.press()
        lease.command, lease.heard = command, now
        lease.send(now)
        return True

    def _repeat(self) -> None:
        """Send every leased robot its command, until there is no lease."""
        if self._timer is not None:
            self._timer.cancel()
        now = monotonic()
        for robot_id, lease in list(self._leases.items()):
            lease.send(now)
            if lease.wheels is not None and (lease.wheels.gives_way or now - lease.heard > GONE):
                self._lose(robot_id)
        self._timer = self._loop.call_later(PERIOD, self._repeat) if self._leases else None

    def stop(self) -> None:
        for lease in self._leases.values():
            if lease.wheels is not None:
                _halt(lease.wheels)
                lease.wheels.close()
        self._leases.clear()


def _halt(wheels: Wheels) -> None:
    with contextlib.suppress(ZteamError):
        wheels.drive(Twist())
