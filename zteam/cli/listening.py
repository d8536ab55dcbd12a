"""What tools that listen share: a bus, a wait, and the users of a key."""

import argparse
import difflib
import sys
import threading
from collections.abc import Callable, Collection, Iterable, Sequence
from typing import NamedTuple

from zteam import names
from zteam.bus import Bus, BusOptions, connect
from zteam.bus.presence import ProcessInfo, find_processes, holder_text, names_of_sessions
from zteam.bus.transport import Declaration, RawSample, matches, problem_of
from zteam.cli.arguments import number
from zteam.cli.interrupts import raise_from_now
from zteam.cli.output import print_line
from zteam.clock import monotonic, wait_until
from zteam.config.numbers import MAX_SECONDS
from zteam.errors import UsageError
from zteam.messages import Message, type_of_encoding
from zteam.messages.topics import type_of_key
from zteam.names import strip_slash

_PATIENCE = 0.5
"""Host seconds for processes to tell their names; one that hangs is shown by its session."""


class KeyUsers(NamedTuple):
    """The publishers and subscribers of all sessions of zteam but the tool's own, by the names of their processes."""

    declarations: Sequence[Declaration]
    processes: Sequence[ProcessInfo]
    """Those of zteam; one may be there with several names."""

    def publishers(self, key_expr: str) -> list[str]:
        """The processes that publish on keys of `key_expr`."""
        return self._names(key_expr, publishes=True)

    def subscribers(self, key_expr: str) -> list[str]:
        """The processes that subscribe to keys of `key_expr`."""
        return self._names(key_expr, publishes=False)

    def _names(self, key_expr: str, *, publishes: bool) -> list[str]:
        sessions = {d.session for d in self.declarations if d.publishes == publishes and matches(d.key, key_expr)}
        return self.name_sessions(sessions, key_expr)

    def name_sessions(self, sessions: Iterable[str], key: str) -> list[str]:
        """The users of a key by name, sorted; one that is no process of zteam by its session's id."""
        known = names_of_sessions(self.processes, key)
        return sorted(holder_text(known.get(session), session) for session in sessions)

    def known_keys(self, heard: Iterable[str] = ()) -> list[str]:
        """Every key with a publisher or a subscriber. A wildcard is a key of each robot here and in `heard`."""
        robots = self.robots(heard)
        return sorted({key for d in self.declarations for key in names.keys_in(d.key, robots)})

    def robots(self, heard: Iterable[str] = ()) -> list[int]:
        """The ids of the robots that have a key of their own, declared or `heard`."""
        keys = (*(declaration.key for declaration in self.declarations), *heard)
        return sorted({target[0] for target in map(names.split_robot_key, keys) if target is not None})


def find_key_users(bus: Bus) -> KeyUsers:
    """The users of all keys now."""
    declarations = bus.declarations()
    return KeyUsers(declarations, find_processes(bus, timeout=_PATIENCE))


NO_KEYS = "no key has a publisher or a subscriber (is a simulator running? see 'zteam doctor')"


def near_keys(key: str, known: Collection[str]) -> str:
    """`: did you mean X or Y?`: the keys, or frames, that may be meant by `key`, the nearest first; else nothing.

    They end or begin with `key`, are spelt like it, or have a longer last part, as `robot_0/base_scan` for `scan`.
    """
    ordered = sorted(known)
    near = (
        [other for other in ordered if other.endswith(f"/{key}")]
        or [other for other in ordered if other.startswith(f"{key}/")]
        or _most_alike(key, ordered)
        or [other for other in ordered if other.endswith(f"_{key}")]
    )
    return f": did you mean {' or '.join(near[:3])}?" if near else ""


def _most_alike(key: str, known: Sequence[str]) -> list[str]:
    near = difflib.get_close_matches(key, known, n=3, cutoff=0.8)
    return sorted(near, key=lambda other: (-difflib.SequenceMatcher(None, other, key).ratio(), other))


def where_to_look(key: str, known: Collection[str]) -> str:
    """The end of a sentence about a `key` without users: the `known` keys that may be meant, else what to do."""
    return near_keys(key, known) or (": see 'zteam topic list'" if known else f": {NO_KEYS}")


PATIENCE = 5.0
"""Seconds to wait for the router given with `--connect`."""
ONCE_LIMIT = 10.0
"""Host seconds for which a script waits for one message, or one transform."""
SURVEY = 1.2
"""Seconds of a survey of the bus: longer than a tick and than the period of a robot's status."""


def open_bus(options: BusOptions) -> Bus:
    """Open a session for a tool; Ctrl+C closes it."""
    raise_from_now()
    return connect(options, patience=PATIENCE)


def check_key(text: str) -> str:
    """The key expression that a user typed, without its leading slash. Raises UsageError that names the fix."""
    key = strip_slash(text)
    if problem := problem_of(key):
        meant = "/".join(filter(None, key.replace("robot_*", "robot_$*").split("/")))
        hint = f": write {meant!r}" if meant and not problem_of(meant) else ""
        raise UsageError(f"{text!r} is not a key expression ({problem.partition(': ')[2] or problem}){hint}")
    return key


def kind_of(sample: RawSample, given: type[Message] | None) -> type[Message] | None:
    """The type of a payload: the one given, else that of its encoding, else that of its key."""
    return given or type_of_encoding(sample.encoding) or type_of_key(sample.key)


def add_timeout(parser: argparse.ArgumentParser, what: str) -> None:
    """Add `--timeout`, after which the command fails without `what`."""
    parser.add_argument(
        "--timeout",
        type=number(0.0, MAX_SECONDS, "host seconds"),
        metavar="S",
        help=f"fail after S host seconds without {what} (default: {ONCE_LIMIT:g} with --once where the output is no "
        "terminal, else no limit)",
    )


def limit_of(args: argparse.Namespace) -> tuple[float | None, bool]:
    """The time-out that holds, in host seconds, and whether it is that of a script that asks for one message.

    None for no limit. Such a script must not wait for ever, and gets one line.
    """
    if args.timeout is None and args.once and not sys.stdout.isatty():
        return ONCE_LIMIT, True
    return args.timeout, False


class Waiter:
    """A condition that callbacks notify and a tool waits for; a long wait is reported to the user."""

    def __init__(self) -> None:
        self.changed = threading.Condition()

    def notify(self) -> None:
        """Wake the waiting thread to check its condition."""
        with self.changed:
            self.changed.notify_all()

    def wait(self, ready: Callable[[], bool], timeout: float | None, what: str) -> bool:
        """Wait until `ready()`, for at most `timeout` s if given; return whether it is ready.

        After 2 s say on stderr that the tool waits for `what`, unless that is empty.
        """
        start, reported = monotonic(), False
        with self.changed:
            while not ready():
                waited = monotonic() - start
                if timeout is not None and waited >= timeout:
                    return False
                if what and waited >= 2.0 and not reported:
                    reported = True
                    print_line(f"waiting for {what} (Ctrl+C to give up)", file=sys.stderr)
                left = 0.5 if timeout is None else min(0.5, timeout - waited)
                wait_until(self.changed, ready, max(0.0, left))
        return True


def wait_for_message(
    bus: Bus, waiter: Waiter, ready: Callable[[], bool], timeout: float | None, key: str, *, quiet: bool = False
) -> bool:
    """Wait until `ready()`, for at most `timeout` s if given; return whether it is ready.

    When no message has come for a while, say on stderr whether anything publishes on `key`, unless `quiet`.
    """
    if timeout is not None and (quiet or timeout <= SURVEY):
        return waiter.wait(ready, timeout, "")
    if waiter.wait(ready, SURVEY, ""):
        return True
    print_line(f"{silence(bus, key)} (waiting for a message; Ctrl+C to give up)", file=sys.stderr)
    return waiter.wait(ready, None if timeout is None else timeout - SURVEY, "")


def silence(bus: Bus, key: str) -> str:
    """Why no message may have come on `key`: its publishers, or the published keys that are near."""
    users = find_key_users(bus)
    if publishers := users.publishers(key):
        return f"{key} is published by {', '.join(publishers)}, but nothing has come yet"
    published = [other for other in users.known_keys() if users.publishers(other)]
    return f"nothing publishes {key}{where_to_look(key, published)}"
