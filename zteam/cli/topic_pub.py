"""`zteam topic pub`: publish what was typed, and tell how many subscribers it reaches."""

import argparse
import itertools
import sys
from collections.abc import Sequence

from zteam import names
from zteam.bus import Bus
from zteam.bus.bus import Publisher
from zteam.bus.topics import type_of_key
from zteam.bus.transport import RawSample
from zteam.cli.key_users import KeyUsers, find_key_users, near_keys
from zteam.cli.listening import SURVEY, Waiter, check_key, open_bus
from zteam.cli.options import bus_options
from zteam.cli.tool_clock import open_clock, ticker
from zteam.clock import AutoClock
from zteam.errors import UsageError
from zteam.messages import Message, Time, encoding_of, message_type, time_from_ns
from zteam.messages.jsonform import from_words
from zteam.numbers import counted
from zteam.robot_ids import format_robot_ids


class _Words:
    """The typed message. It is made anew for every publication if it holds the time of that moment."""

    def __init__(self, kind: type[Message], words: Sequence[str]) -> None:
        self._kind, self._words = kind, words
        self.hold_time = False
        self._message = from_words(kind, words, self._note)

    def _note(self) -> Time:
        self.hold_time = True
        return Time()

    def message(self, clock: AutoClock | None) -> Message:
        """The message to publish now."""
        if not self.hold_time or clock is None:
            return self._message
        return from_words(self._kind, self._words, lambda: time_from_ns(clock.now()))


class _Audience:
    """The subscribers of a key: tells their names, and again when the first one has come or the last one has gone."""

    def __init__(self, bus: Bus, key: str, publisher: Publisher[Message]) -> None:
        self._bus, self._key, self._publisher = bus, key, publisher
        self._matching = publisher.find_subscribers()
        self._known: list[str] | None = None
        """By name; None if they tell no name."""

    def tell(self, what: str, users: KeyUsers) -> None:
        """Print that `what` is published, and the subscribers; warn if there is none."""
        self._tell(what, users, self._find(users))

    def _tell(self, what: str, users: KeyUsers, known: list[str] | None) -> None:
        self._known = known
        print(f"publishing {what} {self._describe()}", flush=True)
        if self._known == []:
            hint = "" if users.publishers(self._key) else near_keys(self._key, users.known_keys())
            _say(f"nothing subscribes to {self._key}{hint}")

    def look(self) -> None:
        """Tell again if the subscribers have changed."""
        if self._publisher.find_subscribers() == self._matching:
            return
        self._matching = not self._matching
        users = find_key_users(self._bus)
        # A session that closes may tell of a subscriber that it has no more.
        known = self._find(users) if self._matching else []
        if known != self._known:
            self._tell(f"on {self._key}", users, known)

    def _find(self, users: KeyUsers) -> list[str] | None:
        found = users.subscribers(self._key)
        if found or not self._publisher.find_subscribers():
            return found
        # One that has come since `users` were asked tells its name now.
        return find_key_users(self._bus).subscribers(self._key) or None

    def _describe(self) -> str:
        if self._known is None:
            return "to subscribers that tell no name (frozen, or no processes of zteam)"
        subscribers = f"{counted(len(self._known), 'subscriber')}: {', '.join(self._known)}"
        return f"to {subscribers if self._known else 'no subscriber yet'}"


def publish(args: argparse.Namespace) -> int:
    """Publish once, a number of times or until Ctrl+C."""
    key, kind = check_key(args.key), message_type(args.type)
    if names.is_wildcard(key):
        raise UsageError(f"{args.key!r} is a wildcard: give one key")
    words = _Words(kind, args.values)
    times = 1 if args.once else args.times
    bus = open_bus(bus_options(args))
    try:
        # Before the question: when that is answered, the publisher knows whether it has a subscriber.
        publisher = bus.publisher(key, kind)
        users = find_key_users(bus)
        check_type(bus, key, kind, users)
        clock = open_clock(bus, args.clock) if times != 1 or words.hold_time else None
        audience = _Audience(bus, key, publisher)
        how = (
            "once" if times == 1 else f"at {args.rate:g} Hz" if times is None else f"{times} times at {args.rate:g} Hz"
        )
        audience.tell(f"{kind.ros_type} on {key} {how}", users)
        _warn_of_others(key, users)
        publisher.put(words.message(clock))
        if clock is None or times == 1:
            return 0
        wait = ticker(clock, 1.0 / args.rate)
        for _ in itertools.count() if times is None else range(times - 1):
            wait()
            publisher.put(words.message(clock))
            audience.look()
    finally:
        bus.close()
    return 0


def _say(text: str) -> None:
    print(f"zteam topic pub: {text}", file=sys.stderr, flush=True)


def _warn_of_others(key: str, users: KeyUsers) -> None:
    """Warn of other publishers, and of a robot that is not there: the simulator subscribes to the keys of any robot."""
    if others := users.publishers(key):
        _say(f"{key} is published by {', '.join(others)} too: subscribers get the messages of both; end one of them")
    target, robots = names.split_robot_key(key), users.robots()
    if target is not None and robots and target[0] not in robots:
        _say(f"no process publishes anything of {names.robot_name(target[0])}; robots: {format_robot_ids(robots)}")


def check_type(bus: Bus, key: str, kind: type[Message], users: KeyUsers) -> None:
    """Raise UsageError if the key carries messages of another type, by its name or by what is heard on it."""
    known = type_of_key(key)
    carried = f"application/cdr;{known.ros_type}" if known is not None else ""
    if known is None and users.publishers(key):
        carried = _heard_encoding(bus, key)
    expected = encoding_of(kind)
    if carried.startswith("application/cdr;") and carried != expected:
        raise UsageError(f"{key} carries {carried.partition(';')[2]}, not {kind.ros_type}")


def _heard_encoding(bus: Bus, key: str) -> str:
    """The encoding of a message on the key, or of its latched one; empty if none comes."""
    heard: list[str] = []
    waiter = Waiter()

    def take(sample: RawSample) -> None:
        heard.append(sample.encoding)
        waiter.notify()

    subscription = bus.subscribe_raw(key, take, latched=True)
    try:
        waiter.wait(lambda: bool(heard), SURVEY, "")
    finally:
        subscription.close()
    return heard[0] if heard else ""
