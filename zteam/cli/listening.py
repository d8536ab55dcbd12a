"""What tools that listen have in common: waiting with a word to the user, and a look at everything on the bus."""

import sys
import threading
from collections.abc import Callable

import msgspec

from zteam.bus import Bus, BusOptions, connect
from zteam.bus.topics import type_of_key
from zteam.bus.transport import RawSample
from zteam.cli.interrupts import raise_from_now
from zteam.clock import monotonic, wait_until
from zteam.errors import UsageError
from zteam.messages import Message, message_type, type_of_encoding
from zteam.names import strip_slash

PATIENCE = 5.0
"""Seconds that a tool waits for a router it was told to use."""
SURVEY = 1.2
"""Seconds that a look at the bus takes: more than a tick and than the period of a robot's status."""


def open_bus(options: BusOptions) -> Bus:
    """A session for a tool, which Ctrl+C closes."""
    raise_from_now()
    return connect(options, patience=PATIENCE)


def check_key(text: str) -> str:
    """A key expression as a user types it, without its leading slash. Raises UsageError with the way out."""
    import zteam.bus.keys as keys

    key = strip_slash(text)
    problem = keys.problem_of(key)
    if problem:
        hint = f": write {key.replace('robot_*', 'robot_$*')!r}" if "robot_*" in key else ""
        raise UsageError(f"{text!r} is no key expression ({problem}){hint}")
    return key


def kind_of(sample: RawSample, given: type[Message] | None) -> type[Message] | None:
    """The type of a payload: as given, as its encoding says, or as its key has it."""
    return given or type_of_encoding(sample.encoding) or type_of_key(sample.key)


def given_type(name: str | None) -> type[Message] | None:
    """The type of a --type option."""
    return message_type(name) if name else None


class Waiter:
    """A condition that callbacks set off and a tool waits on, telling the user once it takes long."""

    def __init__(self) -> None:
        self.changed = threading.Condition()

    def notify(self) -> None:
        """Something changed."""
        with self.changed:
            self.changed.notify_all()

    def wait(self, ready: Callable[[], bool], timeout: float | None, what: str) -> bool:
        """Wait until `ready()`, for ever or `timeout` s; after 2 s say on stderr what for, unless `what` is empty."""
        start, said = monotonic(), False
        with self.changed:
            while not ready():
                waited = monotonic() - start
                if timeout is not None and waited >= timeout:
                    return False
                if what and waited >= 2.0 and not said:
                    said = True
                    print(f"waiting for {what} (Ctrl+C to give up)", file=sys.stderr)
                left = 0.5 if timeout is None else min(0.5, timeout - waited)
                wait_until(self.changed, ready, max(0.0, left))
        return True


class KeySurvey(msgspec.Struct):
    """What was heard on one key."""

    key: str
    type: str
    """ROS name, or the encoding, or empty."""
    count: int = 0
    bytes: int = 0
    latched: bool = False
    """Whether it was there before the survey began."""
    sources: list[str] = []
    """Sessions that sent on it, in the order in which they were heard; an empty one stamps no time."""
    rate: float = 0.0
    """Hz over the survey."""


def survey(bus: Bus, key_expr: str, seconds: float = SURVEY) -> list[KeySurvey]:
    """Listen to `key_expr` for a while: every key that carries data, latched ones included."""
    found: dict[str, KeySurvey] = {}
    lock = threading.Lock()

    def take(sample: RawSample, latched: bool) -> None:
        kind = kind_of(sample, None)
        with lock:
            entry = found.setdefault(sample.key, KeySurvey(sample.key, kind.ros_type if kind else sample.encoding))
            if latched:
                entry.latched = True
            else:
                entry.count += 1
            entry.bytes = len(sample.payload)
            if sample.source not in entry.sources:
                entry.sources.append(sample.source)

    start = monotonic()
    live = bus.subscribe_raw(key_expr, lambda s: take(s, False))
    # A latched subscriber also hears live samples; those the plain one counts, so only what came before is taken.
    first_seen: set[str] = set()

    def take_history(sample: RawSample) -> None:
        if sample.key not in first_seen:
            first_seen.add(sample.key)
            with lock:
                fresh = sample.key not in found
            if fresh:
                take(sample, True)

    history = bus.subscribe_raw(key_expr, take_history, latched=True)
    waiter = Waiter()
    waiter.wait(lambda: False, seconds, "data")
    live.close()
    history.close()
    elapsed = monotonic() - start
    with lock:
        for entry in found.values():
            entry.rate = entry.count / elapsed
            entry.latched = entry.latched and entry.count == 0
        return sorted(found.values(), key=lambda e: e.key)
