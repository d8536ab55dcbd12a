"""A node run as a process: a session of its own, errors as exit codes, and what the commands set process-wide."""

import gc
import logging
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from typing import TypeVar

from zteam.bus import Bus, BusOptions, connect
from zteam.errors import ZteamError
from zteam.runtime.faults import log_fault
from zteam.runtime.log_keeper import KEEPER
from zteam.runtime.log_publisher import LogPublisher
from zteam.runtime.node import ClockMode, Node
from zteam.runtime.shutdown import Stop, exit_hard_later

log = logging.getLogger("zteam")

N = TypeVar("N", bound=Node)

SWITCH_INTERVAL = 0.0005
"""Seconds a busy thread keeps the interpreter while a message waits for its callback; 5 ms is Python's default."""


@contextmanager
def open_node(
    name: str, open_bus: Callable[[], Bus], stop: Stop, clock: ClockMode, make: Callable[[str, Bus, Stop, ClockMode], N]
) -> Iterator[N]:
    """Open a session, make a node on it with `make`, and close it on every way out."""
    with ExitStack() as ends:
        ends.callback(KEEPER.begin())
        bus = open_bus()
        try:
            # Its log is all that a process without its name publishes: readers are to see why it does not start.
            lines = LogPublisher(bus, name)
            ends.callback(lines.close)
            bus.holding.begin()
            node = make(name, bus, stop, clock)
        except BaseException:
            bus.close()
            raise
        node.claim.under_name.append(lines)
        node.on_present(lines.catch_up)
        try:
            yield node
        finally:
            # From here on the hard exit watches: closing must not hang.
            stop.request("the process ends")
            lines.catch_up()
            node.close()


def run_node(
    name: str,
    options: BusOptions,
    body: Callable[[N], None],
    clock: ClockMode = "auto",
    make: Callable[[str, Bus, Stop, ClockMode], N] = Node,  # type: ignore[assignment]
) -> int:
    """Run `body(node)` as a command: signals, orderly stop, hard exit, and the interpreter set up for one node.

    Returns the command's exit code.
    """

    def tuned(node: N) -> None:
        # What start-up made stays: the collector need not look through it again and again.
        node.on_present(gc.freeze)
        body(node)

    sys.setswitchinterval(SWITCH_INTERVAL)
    stop = Stop()
    stop.install()
    exit_hard_later(stop)
    return run_body(name, partial(connect, options, stopping=stop), tuned, stop, clock, make)


def run_body(
    name: str,
    open_bus: Callable[[], Bus],
    body: Callable[[N], None],
    stop: Stop,
    clock: ClockMode,
    make: Callable[[str, Bus, Stop, ClockMode], N],
) -> int:
    """Open the node, run `body(node)` and close; return the exit code. An error is logged, a ZteamError as one line.

    The process stays as its caller set it up: log, switch interval and garbage collector are untouched.
    """
    try:
        with open_node(name, open_bus, stop, clock, make) as node:
            try:
                body(node)
            except ZteamError as error:
                return 0 if stop.requested else _say(error)
            except Exception as error:
                # Before the node closes, which may log more.
                return log_fault(error)
    except ZteamError as error:
        return 0 if stop.requested else _say(error)
    return node.exit_code


def _say(error: ZteamError) -> int:
    log.error("%s", error)
    return error.exit_code
