"""The clock of a tool: simulated time if a simulator runs, else the host's; and waiting for moments at a rate of it."""

import math
import sys
from collections.abc import Callable

from zteam.bus import Bus
from zteam.cli.listening import Waiter
from zteam.clock import AutoClock, Every, moments, to_seconds
from zteam.node.output import print_line
from zteam.node.process_node import ClockMode
from zteam.simulator.client import ask_time, follow_clock, team_clock


def open_clock(bus: Bus, mode: ClockMode) -> AutoClock:
    """A decided clock; in simulated time it follows the `clock` key. With `sim`, wait for a simulator."""
    if mode == "auto":
        return team_clock(bus)
    clock = AutoClock()
    if mode == "wall":
        clock.use_wall()
        return clock
    clock.use_simulated()
    waiter = Waiter()
    follow_clock(bus, clock, waiter.notify)
    now = ask_time(bus)
    if now is None:
        waiter.wait(lambda: clock.now() > 0, None, "a simulator's time; --clock wall uses the host's")
    elif now > clock.now():
        clock.set(now)
    return clock


def ticker(clock: AutoClock, period: float) -> Callable[[], None]:
    """A function that waits for the next moment, `period` seconds after the last one (the first: after this call).

    It says once on stderr when simulated time stands still.
    """
    nag = Every(math.inf)

    def warn() -> None:
        if nag.due():
            print_line(still_text(clock), file=sys.stderr)

    return moments(period, clock, warn)


def still_text(clock: AutoClock) -> str:
    """What a tool says when simulated time stands still."""
    now, hint = to_seconds(clock.now()), "see 'zteam sim status' (--clock wall uses the host's time)"
    return f"simulated time stands still at {now:.3f} s: {hint}"
