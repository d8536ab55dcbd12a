"""The clock of a tool: simulated time if a simulator runs, else the host's; and waiting for moments at a rate of it."""

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
    """A decided clock; in simulated time it follows the `clock` key.

    With `auto`, ask the simulator itself: a tool that just started has received no `clock` message yet, and receives
    none while the world is paused. With `sim`, wait for a simulator.
    """
    clock = AutoClock()
    if mode == "wall":
        clock.use_wall()
        return clock
    waiter = Waiter()

    def on_clock(_key: str, message: Clock) -> None:
        clock.sim.set(ns_from_time(message.clock))
        waiter.notify()

    subscription = bus.subscribe(names.CLOCK, Clock, on_clock)
    now = _ask_time(bus)
    if now is None and mode == "auto":
        subscription.close()
        clock.use_wall()
        return clock
    clock.use_simulated()
    if now is None:
        waiter.wait(lambda: clock.now() > 0, None, "a simulator's time; --clock wall uses the host's")
    elif now > clock.now():
        clock.sim.set(now)
    return clock


def _ask_time(bus: Bus) -> int | None:
    """The simulator's time in ns; None without a simulator, 0 if it does not answer."""
    try:
        answers = bus.query(names.service_key(names.SIMULATOR, "status"), SimStatus)
    except BusError:
        return 0  # it runs, but is busy or frozen
    return answers[0][1].now if answers else None


def ticker(clock: AutoClock, period: float) -> Callable[[], None]:
    """A function that waits for the next moment, `period` seconds after the last one (the first: after this call).

    It says once on stderr when simulated time stands still.
    """
    ticks, warned = Ticker(period, clock), False

    def warn() -> None:
        nonlocal warned
        if not warned:
            warned = True
            print(still_text(clock), file=sys.stderr)

    return lambda: ticks.wait(warn)


def still_text(clock: AutoClock) -> str:
    """What a tool says when simulated time stands still."""
    return (
        f"simulated time stands still at {to_seconds(clock.now()):.3f} s: see 'zteam sim status' "
        "(--clock wall uses the host's time)"
    )
