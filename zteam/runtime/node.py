"""The node that every process has: a named process on the bus that knows the team's time."""

import logging
from collections.abc import Callable
from typing import Literal

from zteam import names
from zteam.bus import Bus
from zteam.bus.transport import Closeable
from zteam.clock import AutoClock, Rate, monotonic, to_seconds
from zteam.messages import Clock, ns_from_time
from zteam.runtime.base_node import BaseNode
from zteam.runtime.ended_time import EndedTime
from zteam.runtime.shutdown import Stop

log = logging.getLogger("zteam")

WALL_AFTER = 0.5
"""Host seconds of data without a sign of a simulator after which this is a real base, in wall time."""
ClockMode = Literal["auto", "sim", "wall"]
CLOCK_MODES: tuple[ClockMode, ...] = ("auto", "sim", "wall")
"""Which time a process works in: simulated time if there is a simulator, else the host's; or always one of the two."""


class Node(BaseNode):
    """A BaseNode that takes its time from the simulator's clock or ticks, or from the host where there is neither."""

    def __init__(self, name: str, bus: Bus, stop: Stop, clock: ClockMode = "auto") -> None:
        super().__init__(name, bus, stop)
        self.clock = AutoClock()
        if clock == "sim":
            self.clock.use_simulated()
        elif clock == "wall":
            self.clock.use_wall()
        self.wakes_with_clock = False
        """Whether every tick of the simulator's clock wakes the main loop."""
        self.ended_time = EndedTime()
        """Messages of the time before the last jump back may still come."""
        self.clock.sim.on_jump_back(self.ended_time.jump)
        self._simulators: set[str] = set()
        self._on_simulator_lost: list[Callable[[], None]] = []
        self._clock_input: Closeable | None = None
        self._follows_clock = False

    def on_time_reset(self, callback: Callable[[], None]) -> None:
        """Call `callback()` when simulated time jumps back: the world was reset, or its simulator started anew.

        It runs under `changed`, before anything of the new time. An error of it ends the process.
        """
        self.clock.sim.on_jump_back(lambda _old, _new: callback())

    def follow_clock(self) -> None:
        """Take simulated time from the bus as soon as there is a simulator. A second call does nothing."""
        if not self._follows_clock:
            self._follows_clock = True
            self.take_time_from_clock()
            self.watch_tokens(names.tokens_key(names.SIMULATOR), self._on_simulator)

    def take_time_from_ticks(self) -> None:
        """In lock-step, take the time from the ticks: the clock would only wake this process once more for each."""
        self.clock.use_simulated()
        if self._clock_input is not None:
            self._clock_input.close()
            self._clock_input = None

    def take_time_from_clock(self) -> None:
        """Out of lock-step, take the time from the clock."""
        if self._clock_input is None:
            # Not as an input of a user's own node, which keeps some messages for later.
            self._clock_input = super().subscribe(names.CLOCK, Clock, self._on_clock, wake=False)

    def set_time(self, stamp: int) -> None:
        """Take simulated time `stamp` (ns); an error of a callback for jumps ends the process."""
        try:
            self.clock.sim.set(stamp)
        except BaseException as error:
            self._fail(error)

    def on_simulator_lost(self, callback: Callable[[], None]) -> None:
        """Call `callback()` under `changed` when the last simulator is gone."""
        self._on_simulator_lost.append(callback)

    def wait_for_moment(self, pace: Rate) -> bool:
        """Wait until the next moment of `pace` in the team's time, and take it; False if something else comes first."""
        clock = self.clock
        left = to_seconds(pace.left(clock.steady()))
        # Simulated time wakes this as it goes on (see `wakes_with_clock`); it may stand still for long.
        if not self.wait(lambda: pace.left(clock.steady()) == 0, 0.5 if clock.simulated else min(left, 0.5)):
            return False
        pace.take(clock.steady())
        return True

    def decide_clock(self, first_data: float) -> None:
        """Work in wall time if data (since host time `first_data`; 0 = none) came for WALL_AFTER without a simulator.

        A base cannot be told from a simulator by its data: the simulator's token or clock may come a little later.
        """
        if not self.clock.decided and first_data and monotonic() - first_data > WALL_AFTER:
            self.clock.use_wall()
            log.info("data without a simulator: working in wall time")

    def _on_clock(self, _key: str, message: Clock) -> None:
        self.clock.use_simulated()
        self.set_time(ns_from_time(message.clock))
        if self.wakes_with_clock:
            self.changed.notify_all()

    def _on_simulator(self, key: str, alive: bool) -> None:
        (self._simulators.add if alive else self._simulators.discard)(key)
        if alive:
            self.clock.use_simulated()
        elif not self._simulators:
            # The next one may not work in lock-step.
            self.take_time_from_clock()
            for callback in self._on_simulator_lost:
                callback()
