"""Faults that the simulator itself carries out in lock-step, as events in simulated time. Pure.

There a process that is stopped for real only holds the world. So a robot that is paused or cut off by a plan is left
out of the ticks until the fault ends, and one with a slow link has its commands obeyed later: the same in every run.
"""

from collections import deque
from collections.abc import Iterable, Mapping

from zteam import names
from zteam.clock import to_ns
from zteam.config.fault import Fault
from zteam.messages import Twist
from zteam.node.kinds import kind_of


def is_simulated(fault: Fault) -> bool:
    """Whether the simulator can carry it out in lock-step: the ticks may go on without the process."""
    kind = kind_of(fault.name)
    goes_on = kind is None or (kind.in_lockstep and fault.name != names.AGGREGATOR)
    is_robot = names.robot_id_of(fault.name) is not None
    # What else a slow link delays is not in the simulator's hands.
    return goes_on and (fault.fault in ("pause", "cut") or (fault.fault == "slow" and is_robot and fault.rate is None))


class FaultPlan:
    """What the faults of a run do in each tick. Times are simulated, in ns since GO; None before GO."""

    def __init__(self, faults: Iterable[Fault], interval: int, oldest: int) -> None:
        """`interval` is a tick, in ns; a command older than `oldest` (ns) is refused, as in real time."""
        self._faults = [*faults]
        self._interval, self._oldest = interval, oldest
        self._late: dict[int, deque[tuple[int, Twist]]] = {}
        """Commands under way to each robot, with the time at which they come."""

    def add(self, fault: Fault) -> None:
        self._faults.append(fault)

    def start_anew(self) -> None:
        self._late.clear()

    def _active(self, time: int | None, *kinds: str) -> list[Fault]:
        if time is None or not self._faults:
            return []
        return [f for f in self._faults if f.fault in kinds and 0 <= time - to_ns(f.at) < to_ns(f.seconds)]

    def absent(self, time: int | None) -> frozenset[str]:
        """Processes without which the tick of this time goes on."""
        return frozenset(fault.name for fault in self._active(time, "pause", "cut"))

    def deliver(self, time: int | None, commands: Mapping[int, Twist]) -> Mapping[int, Twist]:
        """The commands that reach the robots, of those that were given in the tick of this time."""
        slow = self._active(time, "slow")
        delays = {i: to_ns(fault.delay) for fault in slow if (i := names.robot_id_of(fault.name)) is not None}
        if not delays and not self._late:
            return commands
        assert time is not None
        # The end of a delay frees what is held, and of that the newest counts.
        self._late = {i: held for i, held in self._late.items() if i in delays}
        arrived = {i: command for i, command in commands.items() if i not in delays}
        for i, delay in delays.items():
            held = self._late.setdefault(i, deque())
            ticks = -(-delay // self._interval)
            if i in commands and ticks * self._interval <= self._oldest:
                held.append((time + ticks * self._interval, commands[i]))
            while held and held[0][0] <= time:
                arrived[i] = held.popleft()[1]
        return dict(sorted(arrived.items()))
