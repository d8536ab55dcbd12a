"""What tools that listen share: a bus, and a wait that says what it waits for."""

import argparse
import sys
import threading
from collections import deque
from collections.abc import Callable, Collection, Iterator
from contextlib import closing, contextmanager
from typing import Any

from zteam.bus import Bus, connect
from zteam.bus.graph import SURVEY, find_graph, near_keys
from zteam.bus.transport import check_use
from zteam.cli.interrupts import raise_from_now
from zteam.cli.options import add_option, bus_options
from zteam.clock import wait_until
from zteam.config.numbers import MAX_SECONDS
from zteam.errors import ZteamError
from zteam.names import strip_slash
from zteam.node.output import print_line

NO_KEYS = "no key has a publisher or a subscriber (is a simulator running? see 'zteam doctor')"


def where_to_look(key: str, known: Collection[str]) -> str:
    """The end of a sentence about a `key` without users: the `known` keys that may be meant, else what to do."""
    return near_keys(key, known) or (": see 'zteam topic list'" if known else f": {NO_KEYS}")


PATIENCE = 5.0
"""Seconds to wait for the router given with `--connect`."""
ONCE_LIMIT = 10.0
"""Host seconds for which a script waits for one message, or one transform."""


@contextmanager
def open_bus(args: argparse.Namespace) -> Iterator[Bus]:
    """Open the session of a tool; its end, or Ctrl+C, closes it."""
    raise_from_now()
    with closing(connect(bus_options(args), patience=PATIENCE)) as bus:
        yield bus


def check_key(text: str) -> str:
    """The key expression that a user typed, without its leading slash. Raises UsageError that names the fix."""
    key = strip_slash(text)
    check_use("watch", key, False)
    return key


def add_timeout(parser: argparse.ArgumentParser, what: str) -> None:
    """Add `--timeout`, after which the command fails without `what`."""
    default = f"default: {ONCE_LIMIT:g} with --once where the output is no terminal, else no limit"
    text = f"fail after S host seconds without {what} ({default})"
    add_option(parser, "--timeout", typed=(0.0, MAX_SECONDS, "host seconds"), metavar="S", help=text)


def limit_of(args: argparse.Namespace) -> float | None:
    """The time-out in host seconds, None for no limit. A script that asks for one message must not wait for ever."""
    return ONCE_LIMIT if args.timeout is None and args.once and not sys.stdout.isatty() else args.timeout


class Waiter:
    """A condition that callbacks notify and a tool waits for; a long wait is reported to the user."""

    def __init__(self) -> None:
        self.changed = threading.Condition()
        self.received = deque[Any](maxlen=1000)
        """The newest messages that `receive` has taken."""

    def receive(self, *news: Any) -> None:
        """Take a message, the last of `news`: the handler of a subscription."""
        self.received.append(news[-1])
        self.notify()

    def notify(self) -> None:
        with self.changed:
            self.changed.notify_all()

    def wait(self, ready: Callable[[], bool], timeout: float | None, what: str) -> bool:
        """Wait until `ready()`, for at most `timeout` s if given; return whether it is ready.

        After 2 s say on stderr that the tool waits for `what`, unless that is empty.
        """
        first = 2.0 if what and (timeout is None or timeout > 2.0) else timeout
        with self.changed:
            is_ready = wait_until(self.changed, ready, first)
            if is_ready or first == timeout:
                return is_ready
            print_line(f"waiting for {what} (Ctrl+C to give up)", file=sys.stderr)
            return wait_until(self.changed, ready, None if timeout is None else timeout - 2.0)


def wait_for_message(
    bus: Bus, waiter: Waiter, ready: Callable[[], bool], args: argparse.Namespace, key: str, what: str = "message"
) -> None:
    """Wait until `ready()`. Raises ZteamError if that takes longer than --timeout says.

    When no message has come for a while, say on stderr whether anything publishes on `key`, but not in a script.
    """
    limit = limit_of(args)
    first = SURVEY if limit is None or (limit > SURVEY and args.timeout is not None) else limit
    if waiter.wait(ready, first, ""):
        return
    if first != limit:
        print_line(f"{silence(bus, key)} (waiting for a message; Ctrl+C to give up)", file=sys.stderr)
        if waiter.wait(ready, None if limit is None else limit - first, ""):
            return
    raise ZteamError(f"no {what} on {key} within {limit:g} s: {silence(bus, key)}")


def silence(bus: Bus, key: str) -> str:
    """Why no message may have come on `key`: its publishers, or the published keys that are near."""
    graph = find_graph(bus)
    if publishers := graph.publishers(key):
        from zteam.simulator.client import find_status

        status = find_status(bus, SURVEY)
        still = ": the world is paused ('zteam sim resume')" if status is not None and status.paused else ""
        return f"{key} is published by {', '.join(publishers)}, but nothing has come yet{still}"
    published = [other for other in graph.known_keys() if graph.publishers(other)]
    return f"nothing publishes {key}{where_to_look(key, published)}"
