"""A recording by time: its messages in their order, and the state of any moment. Of the file a few chunks are held."""

from array import array
from bisect import bisect_right
from collections import defaultdict
from collections.abc import Sequence
from copy import copy
from functools import lru_cache
from itertools import pairwise
from operator import itemgetter
from statistics import median
from typing import NamedTuple

import numpy as np

from zteam import names
from zteam.clock import to_ns
from zteam.errors import DecodeError, UsageError
from zteam.messages import TFMessage, TransformStamped, decode
from zteam.messages.topics import is_latched
from zteam.record.recording import Recording
from zteam.record.writing import Entry

RECENT = to_ns(1.0)
"""Nanoseconds for which a message belongs to the state, if nothing newer has come on its key and it does not stay."""
_TICK = to_ns(0.1)
"""Nanoseconds of a tick where the recording has none."""
_HELD = 8
"""Chunks, of about 1 MB each."""
_STATUSES = names.STATUS, names.NAVIGATION_STATUS


class Slot(NamedTuple):
    """What a newer message replaces."""

    key: str
    type: str
    frame: str = ""
    """Of transforms: the child frame. The newest transforms of two frames may be in two messages."""

    @property
    def stays(self) -> bool:
        """Whether its message is of the state, however old it is."""
        target = names.split_robot_key(self.key)
        is_status = target is not None and target[1] in _STATUSES
        return bool(self.frame) or is_status or self.key == names.CLOCK or is_latched(self.key)


class _Places:
    """The chunks with messages of a slot, and the times of the first and the last one in each."""

    def __init__(self) -> None:
        self.chunks, self.firsts, self.lasts = array("q"), array("q"), array("q")

    def add(self, chunk: int, time: int) -> None:
        if not self.chunks or self.chunks[-1] != chunk:
            self.chunks.append(chunk)
            self.firsts.append(time)
            self.lasts.append(time)
        self.firsts[-1], self.lasts[-1] = min(self.firsts[-1], time), max(self.lasts[-1], time)


class _Reader:
    """The times of messages, which are taken in the order of the file.

    Where the world was put back to its start, the time of the recording goes on.
    """

    def __init__(self) -> None:
        self.ticks_by = ""
        """The key that tells the ticks: `sim/tick` or, outside of lock-step, `clock`."""
        self.shift = 0
        """How far the recording's time is ahead of the simulated one (ns)."""
        self._tick = self._end = 0

    def take(self, entry: Entry) -> int:
        """The time (ns) of the next message."""
        if entry.key == names.TICK or (entry.key == names.CLOCK and self.ticks_by != names.TICK):
            if entry.key == self.ticks_by and entry.time < self._tick:
                self.shift = self._end
            self.ticks_by, self._tick = entry.key, entry.time
        self._end = max(self._end, entry.time + self.shift)
        return entry.time + self.shift


def is_replayed(key: str) -> bool:
    """Whether a key is published again: no participant of lock-step is to be drawn in, and a recorder has its own."""
    own = key.partition("/")[0] in (names.RECORDER, names.REPLAY)
    return not own and key != names.TICK and names.process_of(key, names.DONE) is None


def transforms_in(entry: Entry) -> Sequence[TransformStamped]:
    """Those of a message; none of one that cannot be read, as any program may have published it."""
    try:
        return decode(TFMessage, entry.data).transforms
    except DecodeError:
        return ()


def _slots_of(entry: Entry) -> list[Slot]:
    if entry.type == TFMessage.ros_type and not is_latched(entry.key):
        slots = [Slot(entry.key, entry.type, each.child_frame_id) for each in transforms_in(entry)]
        if slots:
            return slots
    return [Slot(entry.key, entry.type)]


class Timeline:
    """What is replayed of a recording. All times are nanoseconds from `start` to `end`."""

    def __init__(self, recording: Recording) -> None:
        """Reads the file once. Raises UsageError if it is damaged, or has nothing to replay."""
        self.recording = recording
        self._readers: list[_Reader] = []
        """As they are where each chunk begins."""
        self._places = defaultdict[Slot, _Places](_Places)
        self._load = lru_cache(_HELD)(self._read)
        reader, ticks, spans, shifts = _Reader(), array("q"), _Places(), {0: 0}
        self.keys: set[str] = set()
        """All that were recorded."""
        for chunk in range(recording.chunks):
            self._readers.append(copy(reader))
            for entry in recording.entries_in(chunk):
                before, time = reader.shift, reader.take(entry)
                self.keys.add(entry.key)
                if entry.key == reader.ticks_by:
                    ticks.append(time)
                    if reader.shift != before:
                        shifts[time] = reader.shift
                if is_replayed(entry.key):
                    spans.add(chunk, time)
                    for slot in _slots_of(entry):
                        self._places[slot].add(chunk, time)
        if not spans.chunks:
            raise UsageError(f"{recording.path} has nothing to replay")
        self.start = ticks[0] if ticks else min(spans.firsts)
        """What was there before the first tick comes with it."""
        self.end = max(self.start, *spans.lasts)
        self.is_lockstep = reader.ticks_by == names.TICK
        self.is_simulated = names.CLOCK in self.keys
        """Whether its time is that of a simulator, and not a host's."""
        moments = ticks if ticks else np.arange(self.start, self.end + 1, _TICK)
        self.ticks: list[int] = np.unique(np.asarray(moments)).tolist()
        """Their times (ns)."""
        self.period = round(median(b - a for a, b in pairwise(self.ticks))) if len(self.ticks) > 1 else _TICK
        """Nanoseconds of a tick."""
        self._shifts = shifts
        self._chunks, self._firsts, self._lasts = map(np.asarray, (spans.chunks, spans.firsts, spans.lasts))

    @property
    def topics(self) -> set[tuple[str, str]]:
        """Key and type of what is replayed."""
        return {(slot.key, slot.type) for slot in self._places}

    def tick_at(self, time: int) -> int:
        """The number of the tick of a time; the first is 1."""
        return bisect_right(self.ticks, time)

    def clock_at(self, time: int) -> int:
        """Simulated time (ns) then."""
        return time - self._shifts[max(at for at in self._shifts if at <= time)]

    def _read(self, chunk: int) -> tuple[list[int], list[Entry]]:
        """The messages of a chunk by time, and these times."""
        reader = copy(self._readers[chunk])
        read = [(max(self.start, reader.take(each)), each) for each in self.recording.entries_in(chunk)]
        placed = sorted((each for each in read if is_replayed(each[1].key)), key=itemgetter(0))
        return [time for time, _ in placed], [entry for _, entry in placed]

    def between(self, after: int, until: int) -> list[Entry]:
        """The messages later than `after`, until `until`."""
        found: list[tuple[int, Entry]] = []
        begin = after if after >= self.start else -1
        for chunk in self._chunks[(self._firsts <= until) & (self._lasts > begin)].tolist():
            times, entries = self._load(chunk)
            part = slice(bisect_right(times, after), bisect_right(times, until))
            found += zip(times[part], entries[part], strict=True)
        return [entry for _, entry in sorted(found, key=itemgetter(0))]

    def state_at(self, time: int) -> list[Entry]:
        """The newest message of each slot then, the oldest first."""
        due = defaultdict[int, set[Slot]](set)
        for slot, places in self._places.items():
            at = bisect_right(places.firsts, time) - 1
            if at >= 0 and (slot.stays or places.lasts[at] >= time - RECENT):
                due[places.chunks[at]].add(slot)
        found: list[tuple[int, int, int, Entry]] = []
        for chunk, slots in due.items():
            times, entries = self._load(chunk)
            at, keys = bisect_right(times, time), {slot.key for slot in slots}
            while slots and at:
                at -= 1
                if entries[at].key in keys and (newest := slots.intersection(_slots_of(entries[at]))):
                    slots -= newest
                    if times[at] >= time - RECENT or any(slot.stays for slot in newest):
                        found.append((times[at], chunk, at, entries[at]))
        return [entry for *_, entry in sorted(found, key=itemgetter(0, 1, 2))]
