"""The bundle that is being filled, without a bus: which robots' transforms it has, and whether it may leave."""

from collections.abc import Iterable
from collections.abc import Set as AbstractSet

PATIENCE = 0.03
"""Host seconds that a bundle waits for the last robot of its tick; by the host's clock, because simulated time stands
still within a tick."""


class Bundle:
    """Which robots have spoken for which tick. Stamps are in ns.

    In real time a bundle waits for the robots that spoke for the tick before: a robot that falls silent delays it by
    PATIENCE once, and is then not waited for until it speaks again. In lock-step it waits for every robot of the world.
    """

    def __init__(self, placed: Iterable[int] = ()) -> None:
        self.placed = set(placed)
        """Robots that have sent their fixed transforms."""
        self.stamp = 0
        """The bundle's tick: its newest stamp."""
        self._opened: float | None = None
        """Host time of the bundle's first transform; None while it is empty."""
        self._spoken: dict[int, int] = {}
        """Real time: robots that a bundle waits for, and the stamp that each spoke for last."""
        self._fresh: set[int] = set()
        """Lock-step: robots that have spoken for `stamp`."""
        self._left: set[int] = set()
        """Lock-step: robots whose transforms of `stamp` have left."""

    @property
    def is_open(self) -> bool:
        """Whether it holds transforms of real time that have not left."""
        return self._opened is not None

    def is_old(self, now: float) -> bool:
        """Whether it has waited for PATIENCE at host time `now`."""
        return self._opened is not None and now - self._opened >= PATIENCE

    def ends_with(self, stamp: int) -> bool:
        """Whether transforms of `stamp` begin the next tick, so that this bundle must leave without them."""
        return self._opened is not None and stamp > self.stamp

    def take(self, robot_id: int, stamp: int, now: float) -> bool:
        """Real time: a robot's transforms are in, at host time `now`; whether all robots have spoken."""
        if self._opened is None:
            self._opened, self.stamp = now, stamp
        self.stamp = max(self.stamp, stamp)
        self._spoken[robot_id] = stamp
        return all(spoken >= self.stamp for spoken in self._spoken.values())

    def close(self) -> None:
        """It has left."""
        self._opened = None
        self._left = {*self._fresh}

    def forget_silent(self) -> None:
        """Do not wait any more for robots that have not spoken for this tick."""
        self._spoken = {robot_id: stamp for robot_id, stamp in self._spoken.items() if stamp >= self.stamp}

    def take_in_lockstep(self, robot_id: int, stamp: int) -> None:
        """Lock-step: a robot has spoken for the tick of `stamp`, which itself may arrive later."""
        if stamp > self.stamp:
            self.stamp = stamp
            self._fresh.clear()
            self._left.clear()
        if stamp == self.stamp:
            self._fresh.add(robot_id)

    def has_all(self, robots: AbstractSet[int]) -> bool:
        """Lock-step: whether all these robots have spoken for `stamp`, and their fixed transforms have come."""
        return len(self._fresh) >= len(robots) and robots <= self._fresh and robots <= self.placed

    def may_leave(self, robots: AbstractSet[int]) -> bool:
        """Lock-step: whether it is complete and has not left yet."""
        return self.has_all(robots) and self._fresh != self._left
