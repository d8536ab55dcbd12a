"""The world of a team under test, whose time goes on where the test lets it.

In lock-step the world stands still in between, and after each call the test sees what was measured at the last tick.
"""

import math
from collections.abc import Callable
from concurrent.futures import wait
from functools import partial

from zteam import names
from zteam.clock import HOST_FACTOR, monotonic
from zteam.errors import BusError, UsageError
from zteam.node.kinds import kind_of
from zteam.simulator.client import SimStatus, StepRequest
from zteam.team.run.team_run import RunState
from zteam.team.run.threads import in_thread
from zteam.team.testing.hangs import LOOK
from zteam.team.testing.watch import START_LIMIT, TeamTimeout, Watch

STALL_LIMIT = 60.0 * HOST_FACTOR
"""Host seconds during which simulated time may stand still in a wait."""
_SLICE = 50
"""Ticks of one request to the simulator."""


class World:
    """Calls that let simulated time pass. Each raises TeamFailure for a process that ends or hangs meanwhile."""

    def __init__(self, watch: Watch) -> None:
        self._watch = watch

    def need_team(self, call: str) -> None:
        """Raise UsageError before anything was opened: nothing would ever happen."""
        if self._watch.run.state is RunState.NEW:
            raise UsageError(f"team.{call}: no process runs yet: call team.start or team.launch first")

    @property
    def now(self) -> float:
        """Simulated seconds."""
        return self._watch.view.now / 1e9

    def wait_for_go(self) -> None:
        """As `Team.wait_for_go`."""
        self.need_team("wait_for_go")
        watch = self._watch
        if not watch.wait(lambda: watch.is_go):
            raise TeamTimeout("no GO: " + "; ".join(watch.lines(names.MONITOR)[-3:]))
        if watch.interval:
            if not watch.wait(lambda: watch.sim.report().ticks > 0):
                raise TeamTimeout(f"the first tick is held: waiting for {watch.sim.status().waiting_for}")
            watch.take_status(watch.sim.status())

    def run(self, seconds: float) -> None:
        """As `Team.run`."""
        if not 0.0 <= seconds < math.inf:
            raise UsageError(f"team.run({seconds!r}): give the seconds of simulated time that are to pass, 0 or more")
        self.need_team("run")
        if self._watch.interval:
            self._step(round(seconds * 1e9 / self._watch.interval))
            return
        end = self.now + seconds
        self._until_in_real_time(lambda: self.now >= end, end, seconds)

    def at(self, tick: int) -> None:
        """As `Team.at`."""
        self.need_team("at")
        if not self._watch.interval:
            raise UsageError("at() needs lock-step: in real time no tick is waited for")
        now = self._watch.sim.status().tick
        if tick < now:
            raise UsageError(f"the world is at tick {now} already, beyond {tick}")
        self._step(tick - now)

    def until(self, condition: Callable[[], bool], within: float) -> None:
        """As `Team.until`."""
        self.need_team("until")
        end = self.now + within
        if not self._watch.interval:
            self._until_in_real_time(condition, end, within)
            return
        while not condition():
            if self.now >= end:
                raise self._not_true(within)
            self._step(1)

    def _until_in_real_time(self, condition: Callable[[], bool], end: float, within: float) -> None:
        came_true, last, since = False, self.now, monotonic()

        def is_over() -> bool:
            nonlocal came_true, last, since
            came_true = condition()
            if self.now != last:
                last, since = self.now, monotonic()
            elif monotonic() - since > STALL_LIMIT:
                raise TeamTimeout(f"simulated time stands still at {self.now:.1f} s")
            return came_true or self.now > end

        self._watch.wait(is_over, math.inf)
        if not came_true:
            raise self._not_true(within)

    def _not_true(self, within: float) -> TeamTimeout:
        """The error of a condition that did not come true, with where the robots are."""
        seconds = f"{within:g} simulated second{'' if within == 1 else 's'}"
        return TeamTimeout(f"not true within {seconds} (now {self.now:.1f} s){self._watch.seen.describe()}")

    def _step(self, ticks: int) -> None:
        """Run so many ticks, and wait until the messages of the last one are in view."""
        watch, key = self._watch, names.service_key(names.SIMULATOR, "step")
        limit = max(STALL_LIMIT, 2.0 * watch.silence_limit)
        for done in range(0, ticks, _SLICE):
            watch.check()
            request = StepRequest(min(_SLICE, ticks - done))
            # A node that hangs in this process may hold whatever the answer needs.
            answer = in_thread(partial(watch.bus.ask, key, SimStatus, request, timeout=limit))
            while not answer.done():
                watch.check()
                wait([answer], LOOK)
            try:
                status = answer.result()
            except BusError as error:
                # The end of a process says more.
                watch.check()
                raise TeamTimeout(f"simulated time stands still at {self.now:.1f} s: {error}") from None
            watch.take_status(status)

            def arrived(status: SimStatus = status) -> bool:
                # Each look at the view looks for processes that have failed.
                return watch.view.reaches(status.now, status.robots)

            if not arrived():
                # No message was lost in tens of thousands of ticks, but the bus does not promise that.
                watch.sim.repeat()
                if not watch.wait(arrived):
                    raise TeamTimeout(f"what the simulator sent at {status.now / 1e9:.1f} s did not arrive")

    def wait_for_return(self, name: str) -> None:
        """Wait until a process is there that was started again; in lock-step, until it takes part in the next tick."""
        self._watch.wait_for_processes(name)

        def takes_part() -> bool:
            status = self._watch.sim.status()
            return name in status.joining or name in status.participants

        kind = kind_of(name)
        may_take_part = kind is not None and kind.in_lockstep
        if self._watch.interval and may_take_part and not self._watch.wait(takes_part):
            raise TeamTimeout(f"{name} does not take part in lock-step within {START_LIMIT:g} s")

    def wait_until_left(self, name: str) -> None:
        """Lock-step: wait until a process that has ended takes no part any more: the next tick is without it."""
        watch, kind = self._watch, kind_of(name)
        may_take_part = kind is None or kind.in_lockstep
        if not watch.interval or not may_take_part or not watch.view.alive(names.SIMULATOR):
            return
        if not watch.wait(lambda: name not in watch.sim.status().participants):
            raise TeamTimeout(f"{name} has ended and still takes part in lock-step after {START_LIMIT:g} s")
