"""When a node's steps are due, and what becomes of a user's own."""

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple, Protocol

from zteam import names
from zteam.clock import Every, Rate, to_ns
from zteam.errors import log
from zteam.messages import RobotDriver, Tick, Twist
from zteam.messages.planar import checked_command
from zteam.node.robot_status import go_epoch
from zteam.node.working import StepWatch

if TYPE_CHECKING:
    from zteam.node.node import Node

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


class UserStep:
    """The steps of a user's node, `step(now)`, and their timer in real time: every `period` seconds."""

    def __init__(self, node: "Node", step: Step, period: float) -> None:
        self._node, self._step, self._period = node, step, period
        is_own = names.navigated_robot_of(node.name) is None
        way_out = "do less in a step" if is_own else "the machine is too busy for it, or it has too many robots"
        self._watch = StepWatch(f"{node.name}: step", "one is due every", way_out)
        self._returned = Every(60.0)
        self._rate: Rate | None = None
        """The moments of its steps. In lock-step the next tick takes the moment that has come."""
        self._is_due = False
        self._forget()
        node.on_time_reset(self._forget)

    def _forget(self) -> None:
        self._held: tuple[int, Twist | None] = -1, None
        """Time (ns) and command of the first tick, which is held: GO opens that tick anew, and chance decides if it was
        answered before."""

    def wait(self, limit: float) -> None:
        """Wait for simulated time, then for GO, then for the next moment."""
        node, clock = self._node, self._node.clock
        if not clock.decided or clock.now() == 0:
            node.wait(lambda: clock.now() > 0, 0.1)
        elif node.wait(lambda: node.pass_gate(node.lacking, go_epoch(node.team, clock.now())), 0.5):
            self._is_due = node.wait_for_moment(self._moments(clock.steady()))

    def _moments(self, now: int) -> Rate:
        if self._rate is None:
            # The first moment is now.
            self._rate, self._node.began = Rate(to_ns(self._period), now - to_ns(self._period)), now
        return self._rate

    def take(self) -> int | None:
        """The time of the moment that has come."""
        is_due, self._is_due = self._is_due, False
        return self._node.clock.now() if is_due else None

    def act(self, due: Due) -> Twist | None:
        """Call the user's step from GO on; in the first tick, which comes again with GO, once."""
        if not self._node.pass_gate(self._node.lacking, due.epoch):
            return None
        if due.tick is not None:
            if due.now == self._held[0]:
                return self._held[1]
            if due.tick.tick == 1:
                # Simulated time begins, perhaps again.
                self._rate = None
            if self._moments(due.now).left(due.now):
                return None
            self._moments(due.now).take(due.now)
        # In lock-step the next tick waits for it.
        command = self._watch.run(lambda: self._step(due.now), self._period if due.tick is None else 0.0, paced=True)
        if command is not None and self._node.robot_id is not None:
            command = checked_command(command, f"{self._node.name}: step", self._node.robot_id)
        elif command is not None:
            if self._returned.due():
                name, kind = self._node.name, type(command).__name__
                log.warning("%s: step returned a %s, which nothing takes: put messages on a publisher", name, kind)
            command = None
        if due.tick is not None:
            self._held = due.now if due.tick.epoch == 0 else -1, command
        self._node.report(due, RobotDriver.BEHAVIOR, command)
        return command


class NoSteps:
    """The timer of a process that takes part in lock-step and takes no steps in real time."""

    def __init__(self, node: "Node") -> None:
        self._node = node

    def wait(self, limit: float) -> None:
        self._node.wait(lambda: False, limit)

    def take(self) -> int | None:
        return None
