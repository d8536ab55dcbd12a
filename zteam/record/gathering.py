"""What a recording holds of what comes over the bus: in lock-step the messages of each tick, and whether all have come.

Pure: no bus, no file. A session's messages come in the order in which it has sent them. In lock-step its answer to a
tick says how many belong to that tick, and `sim/tick` how many the simulator has sent since the one before.
"""

import hashlib
import struct
import sys
from collections import deque
from collections.abc import Iterable, Iterator, Set
from functools import cache, lru_cache

from zteam import names
from zteam.bus.transport import RawSample
from zteam.messages import Clock, Done, Message, String, TFMessage, Tick, decode, encode, ns_from_time
from zteam.messages.message import CDR, REGISTERED, fields_of
from zteam.messages.topics import is_in_ticks, type_of_key
from zteam.record.writing import Entry

TRUTH = names.service_key(names.RECORDER, "ground_truth_sha256")
"""A key of the recording alone: of each tick, the hash of all ground truth."""
_STAMP = struct.Struct("<iI")
_EARLIER_DONE = 76
"""Bytes of an answer without `sent` and what follows, as processes of other programs may send it."""


class _Stream:
    """What a session that takes part has sent since its last answer."""

    def __init__(self) -> None:
        self.pending: list[tuple[str, str, bytes]] = []
        self.held: list[Entry] = []
        """What it has sent in the tick that it has answered, until the next tick shows whether it counts."""
        self.answer = b""
        """Its last answer."""
        self.answered: tuple[int, int] | None = None
        """Epoch and tick of its last answer."""
        self.last: frozenset[tuple[str, str, bytes]] = frozenset()
        """What it had sent until then. What a participant lacks of it comes once more."""


class Gatherer:
    """Give it the messages in the order in which they come; it returns what is to be recorded."""

    def __init__(self, simulators: Set[str]) -> None:
        """`simulators` are the sessions of those in lock-step."""
        self._simulators = simulators
        self.time = 0
        """Of the newest tick or clock (ns); without a simulator the caller sets it."""
        self.tick: Tick | None = None
        """The newest one of lock-step."""
        self.ticks = 0
        self.missed = 0
        """Real time: ticks of which no clock has come."""
        self._interval = sys.maxsize
        """The shortest time between two of them (ns)."""
        self.is_whole = True
        """Whether it has come to the first tick."""
        self.gaps: deque[str] = deque(maxlen=100)
        """What has not come, in words."""
        self.stray: dict[str, str] = {}
        """Processes that publish outside of their steps, so that the run does not repeat: by name, one of the keys."""
        self._inside: frozenset[str] = frozenset()
        self._streams: dict[str, _Stream] = {}
        self._truth: dict[str, bytes] = {}
        self._early: list[tuple[str, bytes, str, list[tuple[str, str, bytes]]]] = []
        """Answers to a tick that itself has not come yet, and what was sent before each."""

    def take(self, sample: RawSample) -> Iterable[Entry]:
        """A message has come."""
        key, source = sample.key, sample.source
        if key == names.TICK and source in self._simulators:
            return self._on_tick(sample.payload, source)
        if self.tick is None:
            if key == names.CLOCK:
                self._on_clock(_stamp_of(Clock.ros_type, sample.payload))
        elif source in self._inside:
            name, is_counted = _part_of(key)
            if name is not None:
                return self._on_done(name, sample.payload, source)
            if is_counted:
                self._streams.setdefault(source, _Stream()).pending.append(
                    (key, type_of_sample(sample), sample.payload)
                )
                return ()
        return [self.beside(sample)]

    def _on_clock(self, stamp: int) -> None:
        """Real time: the clock, one message a tick, shows how many ticks have not come."""
        if stamp <= 0:
            return
        passed, self.time = stamp - self.time, stamp
        if 0 < passed < stamp:
            self._interval = min(self._interval, passed)
            self.missed += round(passed / self._interval) - 1

    def beside(self, sample: RawSample) -> Entry:
        """A message that belongs to no tick."""
        return Entry(sample.key, type_of_sample(sample), self.time, sample.payload)

    def _on_tick(self, data: bytes, source: str) -> Iterator[Entry]:
        tick, before = decode(Tick, data), self.tick
        if before is not None and tick.tick < before.tick:
            # The world begins anew.
            yield from self.rest()
            self._streams.clear()
            self._early.clear()
            before = None
        is_new = before is None or (tick.epoch, tick.tick) != (before.epoch, before.tick)
        if before is None:
            self.is_whole = self.is_whole and tick.tick == 1
        elif is_new:
            stream = self._streams.setdefault(source, _Stream())
            # The first tick is held, and comes again and again with its messages.
            sent = tick.sent if before.tick > 1 else None
            yield from self._end(names.SIMULATOR, stream, before, sent, ns_from_time(tick.stamp))
            if tick.tick > before.tick:
                yield self._hash(before)
                self.ticks += 1
        self.tick = tick
        self.time = ns_from_time(tick.stamp)
        self._inside = frozenset((*tick.sessions, source))
        for session, stream in list(self._streams.items()) if is_new else ():
            held, stream.held = stream.held, []
            if session not in self._inside:
                # What a process has sent in the tick in which it ended does not count.
                del self._streams[session]
                held += [Entry(*each[:2], self.time, each[2]) for each in stream.pending]
                held = [each._replace(tick=0) for each in held]
            yield from held
        if before is None or is_new or tick != before:
            yield Entry(names.TICK, Tick.ros_type, self.time, data, tick.tick)
        early, self._early = self._early, []
        for name, answer, session, sent_before in early:
            stream = self._streams.setdefault(session, _Stream())
            sent_after, stream.pending = stream.pending, sent_before
            yield from self._on_done(name, answer, session)
            stream.pending += sent_after

    def _on_done(self, name: str, data: bytes, source: str) -> Iterator[Entry]:
        done, tick = decode(Done, data), self.tick
        assert tick is not None
        stream, answer = self._streams.setdefault(source, _Stream()), (done.epoch, done.tick)
        if done.tick > tick.tick:
            # The way from the simulator over a participant may be the faster one.
            self._early.append((name, data, source, stream.pending))
            stream.pending = []
            return
        if stream.answered == answer:
            if data == stream.answer:
                # The tick has come again, and so has what was sent in it. Otherwise a request is handed on.
                stream.pending.clear()
            return
        stream.answer = data
        if len(data) <= _EARLIER_DONE:
            # It does not say what it reads, so what comes from outside comes to it past the ticks.
            self.stray.setdefault(name, names.done_key(name))
        first, stream.answered = stream.answered is None, answer
        sent = None if first or done.tick == 1 else done.sent
        # It may come after the next tick: its messages belong to the one that it answers.
        found = [*self._end(name, stream, tick, sent, self.time, done.tick)]
        found.append(Entry(names.done_key(name), Done.ros_type, self.time, data, done.tick))
        if done.tick == tick.tick:
            stream.held += found
        else:
            yield from found

    def rest(self) -> Iterator[Entry]:
        """At the end: the messages of the last tick."""
        for stream in self._streams.values():
            held, stream.held = stream.held, []
            yield from held

    def _end(
        self, name: str, stream: _Stream, tick: Tick, sent: int | None, limit: int, answered: int | None = None
    ) -> Iterator[Entry]:
        """What a session has sent in a tick, or in the one that it has `answered`: `sent` messages, some of them more
        than once."""
        number = tick.tick if answered is None else answered
        pending, stream.pending = stream.pending, []
        if sent is not None and len(pending) != sent:
            # What was sent again, because a participant lacked it, is no other message.
            pending = list(dict.fromkeys(pending))
            # One without a stamp may say the same in each tick.
            again = sorted((each for each in pending if each in stream.last), key=lambda each: not _stamp_of(*each[1:]))
            for each in again[: max(0, len(pending) - sent)]:
                pending.remove(each)
            if len(pending) < sent:
                self.gaps.append(f"tick {number}: {len(pending)} of {sent} messages of {name} have come")
            elif len(pending) > sent:
                self.stray.setdefault(name, pending[-1][0])
        elif sent is None:
            pending = list(dict.fromkeys(pending))
        stream.last = frozenset(pending)
        stamp = ns_from_time(tick.stamp)
        for key, kind, data in pending:
            # The simulator sends what it has measured before the tick, or after it.
            time = max(stamp, min(_stamp_of(kind, data), limit)) if name == names.SIMULATOR else stamp
            yield Entry(key, kind, time, data, number + (time > stamp))
            if key.endswith(names.GROUND_TRUTH):
                self._truth[key] = data

    def _hash(self, tick: Tick) -> Entry:
        """Of the ground truth of a tick that is over, by robot."""
        found = hashlib.sha256(b"".join(self._truth[key] for key in sorted(self._truth))).hexdigest()
        self._truth.clear()
        return Entry(TRUTH, String.ros_type, ns_from_time(tick.stamp), encode(String(found)), tick.tick)


@lru_cache(maxsize=4096)
def _part_of(key: str) -> tuple[str | None, bool]:
    """The process whose answers a key carries, and whether what is published on it belongs to ticks."""
    return names.process_of(key, names.DONE), is_in_ticks(key)


def type_of_sample(sample: RawSample) -> str:
    """The ROS name of a message's type; empty where nothing says it."""
    if sample.encoding.startswith(CDR):
        return sample.encoding.removeprefix(CDR)
    known = type_of_key(sample.key)
    return "" if known is None else known.ros_type


def _stamp_of(kind: str, data: bytes) -> int:
    """The stamp (ns) of a message as it lies in its bytes; 0 for one without."""
    place = _place_of_stamp(kind)
    if place is None or len(data) < place + _STAMP.size:
        return 0
    seconds, ns = _STAMP.unpack_from(data, place)
    return int(seconds * 1_000_000_000 + ns)


@cache
def _place_of_stamp(kind: str) -> int | None:
    """Where the stamp begins: behind the four bytes that name the encoding, and the number of transforms."""
    known: type[Message] | None = REGISTERED.get(kind)
    if known is None:
        return None
    if known is TFMessage:
        return 8
    first = fields_of(known)[:1]
    return 4 if known is Clock or (first and first[0].ros_name == "std_msgs/Header") else None
