"""Whose time a tool goes by: the simulator's if there is one, else the host's; and doing something at a rate of it."""

import sys
from collections.abc import Callable

from zteam import names
from zteam.bus import Bus
from zteam.cli.listening import Waiter
from zteam.clock import AutoClock, Ticker, to_seconds
from zteam.errors import BusError
from zteam.messages import Clock, ns_from_time
from zteam.runtime.node import ClockMode
from zteam.services.simulator import SimStatus


def open_clock(bus: Bus, mode: ClockMode) -> AutoClock:
    """A decided clock; simulated time goes on with what comes over the bus.

    With `auto` the question is put to the simulator itself: who just came has heard nothing yet, and hears nothing of
    a world that stands still. With `sim` it is waited for.
    """
    clock = AutoClock()
    if mode == "wall":
        clock.use_wall()
        return clock
    waiter = Waiter()

    def on_clock(_key: str, message: Clock) -> None:
        clock.sim.set(ns_from_time(message.clock))
        waiter.notify()

    heard = bus.subscribe(names.CLOCK, Clock, on_clock)
    now = _ask_time(bus)
    if now is None and mode == "auto":
        heard.close()
        clock.use_wall()
        return clock
    clock.use_simulated()
    if now is None:
        waiter.wait(lambda: clock.now() > 0, None, "a simulator's time; --clock wall goes by the host's")
    elif now > clock.now():
        clock.sim.set(now)
    return clock


def _ask_time(bus: Bus) -> int | None:
    """The simulator's time in ns; None where there is no simulator, 0 where it does not say."""
    try:
        answers = bus.query(names.service_key(names.SIMULATOR, "status"), SimStatus)
    except BusError:
        return 0  # it is there, but busy or stopped
    return answers[0][1].now if answers else None


def ticker(bus: Bus, period: float, mode: ClockMode) -> Callable[[], None]:
    """A call that waits for the next moment, `period` seconds after this call or after the last one.

    Says once on stderr when simulated time stands still.
    """
    clock = open_clock(bus, mode)
    ticks, told = Ticker(period, clock), False

    def say() -> None:
        nonlocal told
        if not told:
            told = True
            print(
                f"simulated time stands still at {to_seconds(clock.now()):.3f} s: see 'zteam sim status' "
                "(--clock wall goes by the host's time)",
                file=sys.stderr,
            )

    return lambda: ticks.wait(say)
