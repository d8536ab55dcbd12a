"""The team's time for programs that are no nodes: they ask the simulator, and follow its clock from then on."""

from collections.abc import Callable

from zteam import names
from zteam.bus import Bus
from zteam.bus.transport import Closeable
from zteam.clock import AutoClock
from zteam.errors import BusError
from zteam.messages import Clock, ns_from_time
from zteam.simulator.client import read_status


def ask_time(bus: Bus) -> int | None:
    """The simulator's time in ns; None without a simulator, 0 if it does not answer."""
    try:
        status = read_status(bus)
    except BusError:
        return 0  # it runs, but is busy or frozen
    return status.now if status else None


def follow_clock(bus: Bus, clock: AutoClock, on_time: Callable[[], None] = lambda: None) -> Closeable:
    """Set `clock` to simulated time as it goes on, and call `on_time()` then."""

    def take(_key: str, message: Clock) -> None:
        clock.sim.set(ns_from_time(message.clock))
        on_time()

    return bus.subscribe(names.CLOCK, Clock, take)


def team_clock(bus: Bus) -> AutoClock:
    """A decided clock: simulated time if a simulator runs, else the host's.

    The simulator itself is asked: a program that has just started has received no `clock` message yet, and receives
    none while the world is paused.
    """
    clock = AutoClock()
    subscription = follow_clock(bus, clock)
    now = ask_time(bus)
    if now is None:
        subscription.close()
        clock.use_wall()
        return clock
    clock.use_simulated()
    if now > clock.now():
        clock.sim.set(now)
    return clock
