"""The bundle that is being filled, without a bus: which robots' transforms it has, and whether it may leave."""

from collections.abc import Iterable
from collections.abc import Set as AbstractSet

_MOST_TICKS = 8
"""Of lock-step, for which one robot may have spoken: the newest one, the next one, and others."""
PATIENCE = 0.03
"""Host seconds that a bundle waits for the last robot of its tick: simulated time stands still within a tick."""


class Bundle:
    """Which robots have spoken for which tick. Stamps are in ns.

    In real time a bundle waits for the robots that spoke for the tick before: a robot that falls silent delays it by
    PATIENCE once, and is then not waited for until it speaks again. In lock-step it waits for every robot of the world.
    """

    def __init__(self, placed: Iterable[int] = ()) -> None:
        self.placed = set(placed)
        """Robots that have sent their fixed transforms."""
        self.stamp = 0
        """Real time: the bundle's tick, its newest stamp."""
        self._opened: float | None = None
        """Host time of the bundle's first transform; None while it is empty."""
        self._spoken: dict[int, int] = {}
        """Real time: robots that a bundle waits for, and the stamp that each spoke for last."""
        self._fresh: dict[int, set[int]] = {}
        """Lock-step: robots that have spoken, by stamp, from the newest tick on."""
        self._left: dict[int, set[int]] = {}
        """Lock-step: of these, robots whose transforms have left."""

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

    def close(self, stamp: int = 0) -> None:
        """It has left; in lock-step, that of the tick of `stamp`."""
        self._opened = None
        if stamp in self._fresh:
            self._left[stamp] = {*self._fresh[stamp]}

    def forget_silent(self) -> None:
        """Do not wait any more for robots that have not spoken for this tick."""
        self._spoken = {robot_id: stamp for robot_id, stamp in self._spoken.items() if stamp >= self.stamp}

    def take_in_lockstep(self, robot_id: int, stamp: int, newest: int = 0) -> None:
        """Lock-step: a robot has spoken for the tick of `stamp`, which itself may arrive later; `newest` has come."""
        while self._fresh and (oldest := min(self._fresh)) < newest:
            del self._fresh[oldest]
            self._left.pop(oldest, None)
        if stamp >= newest:
            self._fresh.setdefault(stamp, set()).add(robot_id)
        if len(self._fresh) < _MOST_TICKS:
            return
        own = [known for known, robots in self._fresh.items() if robot_id in robots and known != stamp]
        if len(own) >= _MOST_TICKS:
            # It makes them up, and harms itself alone.
            last = max(own)
            self._fresh[last].discard(robot_id)
            if not self._fresh[last]:
                del self._fresh[last]
                self._left.pop(last, None)

    def begun(self, newest: int) -> int:
        """Lock-step: the stamp of the tick that has begun: a robot may have spoken for the one after the `newest`."""
        return min([stamp for stamp in self._fresh if stamp > newest], default=newest)

    def has_all(self, robots: AbstractSet[int], stamp: int) -> bool:
        """Lock-step: whether all these robots have spoken for `stamp`, and their fixed transforms have come."""
        return robots <= self._fresh.get(stamp, set()) and robots <= self.placed

    def leaves(self, robots: AbstractSet[int]) -> int | None:
        """Lock-step: the stamp of a bundle that is complete and has not left yet; None if there is none."""
        for stamp, spoken in sorted(self._fresh.items()):
            if len(spoken) >= len(robots) and self.has_all(robots, stamp) and spoken != self._left.get(stamp):
                return stamp
        return None
