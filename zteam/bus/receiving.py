"""What happens to a sample that arrives: it is checked, decoded, counted and handled."""

import logging
import threading
from collections.abc import Callable, Set
from typing import NamedTuple, TypeVar

import msgspec

from zteam.bus.transport import RawSample, SampleHandler, size_problem
from zteam.clock import Sent, monotonic
from zteam.errors import DecodeError
from zteam.messages import Message, decode, encoding_of
from zteam.messages.message import CDR
from zteam.names import all_robots_key, is_wildcard, split_robot_key

log = logging.getLogger("zteam.bus")

M = TypeVar("M", bound=Message)

MAX_KEYS = 4096
"""A sender can invent keys; beyond this many they are counted together."""
OTHER = "(other keys)"
_MAX_REASON = 300
"""Characters; a reason may repeat what a sender wrote."""
_FIRST_PAUSE, _LONGEST_PAUSE = 1.0, 60.0
"""Host seconds between two warnings about a key: a cause that stays must not fill the log."""
_FAULT = "error while handling a message on %s"


class KeyCount(msgspec.Struct):
    received: int = 0
    dropped: int = 0
    last_drop_age: float | None = None
    """Host seconds since the last message was dropped, when this was told; None if none was."""
    last_drop_reason: str = ""
    """Why it was dropped."""


class _Drop(NamedTuple):
    """The last dropped message of a key, and the last warning about one. Times are the host's."""

    time: float
    reason: str
    warned: float
    pause: float
    """Seconds from that warning to the next; twice as long after each."""


def _next_drop(last: _Drop | None, now: float, reason: str) -> _Drop:
    """What follows `last`; it is warned about if `warned` is `now`."""
    if last is None or now - last.time >= _LONGEST_PAUSE:
        return _Drop(now, reason, now, _FIRST_PAUSE)
    if reason != last.reason and now - last.warned >= _FIRST_PAUSE:
        return _Drop(now, reason, now, _FIRST_PAUSE)
    if now - last.warned >= last.pause:
        return _Drop(now, reason, now, min(2.0 * last.pause, _LONGEST_PAUSE))
    return last._replace(time=now, reason=reason)


class Receiver:
    """Makes the transport's handlers of typed callbacks, and counts what they receive and drop, from any thread.

    Drops of a key are warned about at most once a second, and ever less often for one reason. Robots of which every
    message was dropped share one count.
    """

    def __init__(self) -> None:
        self._lock = threading.RLock()
        self._counts: dict[str, KeyCount] = {}
        self._last: dict[str, _Drop] = {}
        self.sessions: Set[str] | None = None
        """The sessions whose samples are handled as they come; None: those of all. Others' go to `keep`."""
        self.keep: Callable[[RawSample, SampleHandler, bool], bool] = lambda *_: True
        """Keeps a sample of a subscription, latched or not, to give it to the handler later; False: it is handled now
        all the same."""

    def of(self, key: str) -> KeyCount:
        """The key's count. A receiver adds to it without the lock, which is slow: nothing interrupts an addition."""
        with self._lock:
            count = self._counts.get(key)
            if count is None:
                count = self._counts.setdefault(key if len(self._counts) < MAX_KEYS else OTHER, KeyCount())
            return count

    def drop(self, key: str, why: str) -> None:
        """One message was refused; say why."""
        with self._lock:
            count = self.of(key)
            count.dropped += 1
            places, target = [key if key in self._counts else OTHER], split_robot_key(key)
            if target is not None and count.received <= count.dropped:
                # No message of this robot was good: a sender can invent robots, so they share the warnings of a topic.
                places.append(all_robots_key(target[1]))
            now, dropped = monotonic(), count.dropped
            for place in places:
                last = self._last[place] = _next_drop(self._last.get(place), now, why[:_MAX_REASON])
        if last.warned == now:
            log.warning("dropped a message on %s: %s (%d so far)", key, why, dropped)

    def snapshot(self) -> dict[str, KeyCount]:
        """A copy, sorted by key; the ages of the last drops are those of this moment."""
        with self._lock:
            told = {key: KeyCount(count.received, count.dropped) for key, count in sorted(self._counts.items())}
            for key, last in self._last.items():
                if key in told:
                    told[key].last_drop_age, told[key].last_drop_reason = round(monotonic() - last.time, 3), last.reason
            return told

    def decode(self, sample: RawSample, message_type: type[M]) -> M | None:
        """The sample's message, counted; None if it is refused (the counters say why)."""
        if self._refuse(sample, message_type):
            return None
        message = self._read(sample, message_type)
        if message is not None:
            self.of(sample.key).received += 1
        return message

    def _read(self, sample: RawSample, message_type: type[M]) -> M | None:
        content = sample.content
        if isinstance(content, message_type):
            return content
        try:
            payload = content if type(content) is bytes else sample.payload
            if problem := size_problem(payload):
                raise DecodeError(problem)
            return decode(message_type, payload)
        except DecodeError as error:
            self.drop(sample.key, str(error))
            return None

    def messages(
        self,
        message_type: type[M],
        callback: Callable[..., None],
        *,
        latched: bool = False,
        with_source: bool = False,
        problem: Callable[[RawSample], str] | None = None,
        screened: bool = True,
    ) -> SampleHandler:
        """Calls `callback(key, message)`, or `callback(key, message, source)`.

        With `latched`, not for one that another of its key hides (`Sent`). A sample with which `problem` finds one is
        dropped. Unless `screened`, it may come from any session.
        """
        due = encoding_of(message_type)
        newest: dict[str, Sent] = {}
        """Of latched keys: when the last message that counts was sent."""
        known: dict[str, KeyCount] = {}
        """By key: what comes on it again, of the due type, needs no check, which would take most of the time."""

        def handle(sample: RawSample) -> None:
            key, content = sample.key, sample.content
            try:
                # Written out: this comes with every message.
                sessions = self.sessions
                if (
                    sessions is not None
                    and screened
                    and sample.source not in sessions
                    and self.keep(sample, handle, latched)
                ):
                    return
                if latched and key in newest and newest[key].hides(sample.sent(monotonic())):
                    return
                if problem is not None and (why := problem(sample)):
                    self.drop(key, why)
                    return
                count = known.get(key)
                if count is None or sample.encoding != due:
                    if self._refuse(sample, message_type):
                        return
                    count = self.of(key)
                    if len(known) < MAX_KEYS:
                        known[key] = count
                message = content if type(content) is message_type else self._read(sample, message_type)
                if message is None:
                    return
                count.received += 1
                if latched and (key in newest or len(newest) < MAX_KEYS):
                    newest[key] = sample.sent(monotonic())
                if with_source:
                    callback(key, message, sample.source)
                else:
                    callback(key, message)
            except Exception:
                # A fault in one callback must not end the subscription, and no other code sees it after the bus.
                log.exception(_FAULT, key)

        return handle

    def samples(
        self,
        callback: Callable[[RawSample], object],
        only: type[Message] | None = None,
        *,
        latched: bool = False,
        screened: bool = True,
    ) -> SampleHandler:
        """Calls `callback(sample)` for samples of a permitted size and type, and logs its exceptions. Unless
        `screened`, they may come from any session."""

        def handle(sample: RawSample) -> None:
            sessions = self.sessions if screened else None
            if sessions is not None and sample.source not in sessions and self.keep(sample, handle, latched):
                return
            # A message without bytes is a small one.
            if type(sample.content) is bytes and (problem := size_problem(sample.content)):
                self.drop(sample.key, problem)
                return
            if only is not None:
                if self._refuse(sample, only):
                    return
                self.of(sample.key).received += 1
            try:
                callback(sample)
            except Exception:
                log.exception(_FAULT, sample.key)

        return handle

    def _refuse(self, sample: RawSample, message_type: type[Message]) -> bool:
        """Whether a sample is no message of this type on one key, whatever it holds; it is then counted as dropped."""
        key = sample.key
        if is_wildcard(key):
            self.drop(key, "its key is a wildcard, not the name of one topic")
            return True
        encoding = sample.encoding
        if encoding != encoding_of(message_type) and encoding.startswith(CDR):
            given, due = encoding.removeprefix(CDR), message_type.ros_type
            self.drop(key, f"wrong type: it is {given}, {due} is due")
            return True
        return False
