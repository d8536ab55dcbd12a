"""The simulated time of a team under test: the world stands still except where the test lets it go on.

Limits named `within` are simulated seconds, so that a slow machine makes a test slow and not wrong.
"""

import math
from collections.abc import Callable
from typing import Any, Self

from zteam import names
from zteam.clock import HOST_FACTOR, monotonic
from zteam.errors import BusError, UsageError
from zteam.launch.kinds import kind_of
from zteam.messages import Message
from zteam.services.simulator import SimReport, SimStatus, StepRequest
from zteam.testing.processes import START_LIMIT, TeamTimeout
from zteam.testing.view import TeamView
from zteam.testing.watching import WatchedTeam

STALL_LIMIT = 60.0 * HOST_FACTOR
"""Host seconds during which simulated time may stand still in a wait."""

_SLICE = 50
"""Ticks of one request to the simulator."""


class SteppedTeam(WatchedTeam):
    """Processes whose simulated time the test controls."""

    def _listen(self, key: str, kind: type[Message], arrived: Callable[[], bool]) -> None:
        super()._listen(key, kind, arrived)
        if self._interval and self.alive(names.SIMULATOR):
            # A world that stands still publishes no more, so it is asked to publish its last tick again.
            self.sim.repeat()
            self._wait(arrived, START_LIMIT)

    @property
    def report(self) -> SimReport:
        """The simulator's own count of the run from GO on, with `trajectory_sha256`."""
        return self.sim.report()

    @property
    def tick(self) -> int:
        """The tick at which the world stands."""
        return self.sim_status.tick

    @property
    def now(self) -> float:
        """Simulated seconds."""
        return self._view.now / 1e9

    @property
    def is_go(self) -> bool:
        """Whether the monitor has given GO."""
        return self._view.is_go

    @property
    def status(self) -> Any:
        """The newest TeamStatus, or None."""
        return self._view.team_status

    def wait_for_processes(self, *processes: str) -> None:
        """Wait until these names are present on the bus; a process that ends instead fails the test at once."""
        super().wait_for_processes(*processes)
        if names.SIMULATOR in processes:
            status = self.sim_status
            self._interval = status.interval if status.lockstep else 0

    def _need_team(self, call: str) -> None:
        """Raise UsageError before anything was opened: nothing would ever happen."""
        if self._bus is None:
            raise UsageError(f"team.{call}: no process runs yet: call team.start or team.launch first")

    def wait_for_go(self) -> None:
        """Wait until the monitor has given GO; in lock-step, until the first tick after GO is over."""
        self._need_team("wait_for_go")
        if not self._wait(lambda: self.is_go, START_LIMIT):
            raise TeamTimeout("no GO: " + "; ".join(self.lines(names.MONITOR)[-3:]))
        if self._interval and not self._wait(lambda: self.report.ticks > 0, START_LIMIT):
            raise TeamTimeout(f"the first tick is held: waiting for {self.sim_status.waiting_for}")

    def run(self, seconds: float) -> None:
        """Let `seconds` of simulated time pass: in lock-step to the tick."""
        if not 0.0 <= seconds < math.inf:
            raise UsageError(f"team.run({seconds!r}): give the seconds of simulated time that are to pass, 0 or more")
        self._need_team("run")
        if self._interval:
            self._step(round(seconds * 1e9 / self._interval))
            return
        end = self.now + seconds
        self._watch(lambda: self.now >= end, end, seconds)

    def at(self, tick: int) -> Self:
        """Let the world go on until it stands at `tick` (lock-step). Return the team, for the next call."""
        self._need_team("at")
        if not self._interval:
            raise UsageError("at() needs lock-step: in real time no tick is waited for")
        ahead = tick - self.tick
        if ahead < 0:
            raise UsageError(f"the world is at tick {self.tick} already, beyond {tick}")
        self._step(ahead)
        return self

    def until(self, condition: Callable[[], bool], within: float) -> None:
        """Let the world go on until `condition()`, checked after every tick; fail after `within` simulated seconds.

        In real time the condition is checked whenever a message arrives. Simulated time that stands still for
        STALL_LIMIT host seconds fails too.
        """
        self._need_team("until")
        end = self.now + within
        if not self._interval:
            self._watch(condition, end, within)
            return
        while not condition():
            if self.now >= end:
                raise _not_true(within, self.now, self._view)
            self._step(1)

    def _watch(self, condition: Callable[[], bool], end: float, within: float) -> None:
        """Wait in real time until `condition()`."""
        last, quiet_since = self.now, monotonic()
        while True:
            # Without the view's lock: a condition may ask the bus, whose thread may need the lock to go on.
            seen = self._view.version
            if condition():
                self._wait_for_silent()
                return
            if self.now > end:
                raise _not_true(within, self.now, self._view)
            if self.now != last:
                last, quiet_since = self.now, monotonic()
            elif monotonic() - quiet_since > STALL_LIMIT:
                raise TeamTimeout(f"simulated time stands still at {self.now:.1f} s")
            self._view.wait_for_news(seen, 1.0)

    def _step(self, ticks: int) -> None:
        """Run so many ticks, and wait until the messages of the last one are in view."""
        while ticks > 0:
            count = min(ticks, _SLICE)
            ticks -= count
            try:
                key = names.service_key(names.SIMULATOR, "step")
                status = self.bus.ask(key, SimStatus, StepRequest(count), timeout=STALL_LIMIT)
            except BusError as error:
                self._check()
                raise TeamTimeout(f"simulated time stands still at {self.now:.1f} s: {error}") from error
            self._take_status(status)
            self._wait_for_messages_of(status)

    def _wait_for_messages_of(self, status: SimStatus) -> None:
        def arrived() -> bool:
            return self._view.reaches(status.now, status.robots)

        if not arrived():
            # No message was lost in tens of thousands of ticks, but the bus does not promise that.
            self.sim.repeat()
            if not self._wait(arrived, START_LIMIT):
                raise TeamTimeout(f"what the simulator sent at {status.now / 1e9:.1f} s did not arrive")


def _not_true(within: float, now: float, view: TeamView) -> TeamTimeout:
    """The error of a condition that did not come true, with where the robots are."""
    seconds = f"{within:g} simulated second{'' if within == 1 else 's'}"
    return TeamTimeout(f"not true within {seconds} (now {now:.1f} s){view.describe()}")


def wait_until_joined(team: SteppedTeam, name: str) -> None:
    """Lock-step: wait until a process of the team takes part from the next tick on."""

    def takes_part() -> bool:
        status = team.sim_status
        return name in status.joining or name in status.participants

    kind = kind_of(name)
    if team._interval and kind is not None and kind.in_lockstep and not team._wait(takes_part, START_LIMIT):
        raise TeamTimeout(f"{name} does not take part in lock-step within {START_LIMIT:g} s")


def wait_until_left(team: SteppedTeam, name: str) -> None:
    """Lock-step: wait until a process that has ended takes no part any more, so that the next tick is without it."""
    kind = kind_of(name)
    may_take_part = kind is None or kind.in_lockstep
    if not team._interval or not may_take_part or not team.alive(names.SIMULATOR):
        return
    if not team._wait(lambda: name not in team.sim_status.participants, START_LIMIT):
        raise TeamTimeout(f"{name} has ended and still takes part in lock-step after {START_LIMIT:g} s")
